"""Trajectories inside bags."""

import numpy as np
import pytest
from trajectories import helix, write_tum

from fdi_lio_scripts.bag_writing import BagWriter
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.ros_messages import message_class, ros_time
from fdi_lio_scripts.trajectory_io import read_trajectory


def write_poses(path, types):
    """A helix on one topic for each type, named after it."""
    truth = helix(50, start_s=1000.0)
    with BagWriter(str(path), overwrite=False) as bag:
        for stamp, position, quaternion in zip(
            truth.stamps, truth.positions.tolist(), truth.quaternions.tolist()
        ):
            for name in types:
                message = message_class(name)()
                message.header.stamp = ros_time(round(stamp * 1e9))
                pose = getattr(message, "pose", None)
                pose = getattr(pose, "pose", pose)
                t = pose.position if pose else message.transform.translation
                q = pose.orientation if pose else message.transform.rotation
                (t.x, t.y, t.z), (q.x, q.y, q.z, q.w) = position, quaternion
                # recorded late: the stamp of the header must count
                bag.write("/" + name.split("/")[1], message, round(stamp * 1e9) + 30_000_000)
    return truth


@pytest.mark.parametrize(
    "name", ["nav_msgs/Odometry", "geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped"]
)
def test_each_pose_type(tmp_path, name):
    truth = write_poses(tmp_path / "t.bag", [name])
    found = read_trajectory(str(tmp_path / "t.bag"))
    np.testing.assert_allclose(found.stamps, truth.stamps, atol=1e-9)
    np.testing.assert_allclose(found.positions, truth.positions)
    np.testing.assert_allclose(found.quaternions, truth.quaternions)


def test_topic_must_be_named_when_there_are_several(tmp_path):
    write_poses(tmp_path / "t.bag", ["nav_msgs/Odometry", "geometry_msgs/PoseStamped"])
    with pytest.raises(UserError, match="/Odometry, /PoseStamped"):
        read_trajectory(str(tmp_path / "t.bag"))
    assert len(read_trajectory(str(tmp_path / "t.bag"), topic="/Odometry")) == 50
    with pytest.raises(UserError, match="/wrong"):
        read_trajectory(str(tmp_path / "t.bag"), topic="/wrong")


def test_bag_against_tum_on_the_command_line(run_script, tmp_path):
    truth = write_poses(tmp_path / "t.bag", ["nav_msgs/Odometry", "geometry_msgs/PoseStamped"])
    done = run_script(
        "evaluate_trajectory.py",
        tmp_path / "t.bag",
        write_tum(tmp_path / "gt.tum", truth),
        "--topic",
        "/Odometry",
    )
    assert done.returncode == 0, done.stderr
    assert "ATE rmse [m]" in done.stdout
