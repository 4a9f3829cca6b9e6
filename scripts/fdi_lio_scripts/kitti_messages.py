"""Turns KITTI's scans and oxts packets into ROS messages."""

from dataclasses import dataclass
from typing import Any, Tuple

import numpy as np

from . import hdl64, kitti_raw, rotations
from .ros_messages import VELODYNE_POINT, cloud_message, message_class, ros_time

# Noise of the OXTS RT3003 (data sheet: 0.03 degrees roll and pitch, 0.1 degrees heading), as standard
# deviations.
ORIENTATION_SD_RAD = np.radians([0.03, 0.03, 0.1])
ANGULAR_RATE_SD = 0.001  # rad/s: 0.05 degrees/s over the 100 Hz samples
ACCELERATION_SD = 0.01  # m/s^2: 1 mg
POINT_DTYPE_WITHOUT_TIME = np.dtype({
    "names": ["x", "y", "z", "intensity", "ring"],
    "formats": ["<f4", "<f4", "<f4", "<f4", "<u2"],
    "offsets": [0, 4, 8, 12, 16],
    "itemsize": 18,
})


@dataclass(frozen=True)
class CloudOptions:
    """with_time: write the field `time`. clockwise: the way the head turns. intensity_scale: factor on 0..1.
    """

    with_time: bool = True
    clockwise: bool = True
    intensity_scale: float = 1.0


def structured_points(scan: np.ndarray, sweep_s: float, options: CloudOptions) -> Tuple[np.ndarray, str]:
    """Points with ring and, if wanted, time in seconds after the start of the sweep; and how the rings were
    found.
    """
    points = np.zeros(len(scan), dtype=VELODYNE_POINT if options.with_time else POINT_DTYPE_WITHOUT_TIME)
    points["x"], points["y"], points["z"] = scan[:, 0], scan[:, 1], scan[:, 2]
    points["intensity"] = scan[:, 3] * np.float32(options.intensity_scale)
    points["ring"], how = hdl64.rings_of(scan[:, :3])
    if options.with_time:
        points["time"] = sweep_s * hdl64.sweep_share(scan[:, :3], options.clockwise)
    return points, how


def scan_message(points: np.ndarray, stamp_ns: int) -> Any:
    """The sensor_msgs/PointCloud2 of one sweep, stamped with its start."""
    return cloud_message(points, stamp_ns, "velodyne")


def imu_message(stamp_ns: int, row: np.ndarray, quaternion: np.ndarray) -> Any:
    """sensor_msgs/Imu of an oxts row, with the orientation R_enu_imu that the OXTS estimated."""
    message = message_class("sensor_msgs/Imu")()
    message.header.stamp = ros_time(stamp_ns)
    message.header.frame_id = "imu_link"
    q, w, a = message.orientation, message.angular_velocity, message.linear_acceleration
    q.x, q.y, q.z, q.w = quaternion.tolist()
    w.x, w.y, w.z = row[kitti_raw.ANGULAR_RATE].tolist()
    a.x, a.y, a.z = row[kitti_raw.ACCELERATION].tolist()
    message.orientation_covariance = _diagonal(ORIENTATION_SD_RAD**2)
    message.angular_velocity_covariance = _diagonal(np.full(3, ANGULAR_RATE_SD**2))
    message.linear_acceleration_covariance = _diagonal(np.full(3, ACCELERATION_SD**2))
    return message


def fix_message(stamp_ns: int, row: np.ndarray) -> Any:
    """sensor_msgs/NavSatFix of an oxts row."""
    message = message_class("sensor_msgs/NavSatFix")()
    message.header.stamp = ros_time(stamp_ns)
    message.header.frame_id = "imu_link"  # the OXTS gives the position of the IMU, not of its antenna
    message.latitude, message.longitude, message.altitude = row[
        [kitti_raw.LAT, kitti_raw.LON, kitti_raw.ALT]
    ].tolist()
    message.status.service = message.status.SERVICE_GPS
    has_fix = row[kitti_raw.SATELLITES] >= 4
    message.status.status = message.status.STATUS_FIX if has_fix else message.status.STATUS_NO_FIX
    variance = row[kitti_raw.POSITION_ACCURACY] ** 2
    # heights are worse
    message.position_covariance = _diagonal(np.array([variance, variance, 4.0 * variance]))
    message.position_covariance_type = message.COVARIANCE_TYPE_APPROXIMATED
    return message


def quaternions(oxts: kitti_raw.Oxts) -> np.ndarray:
    """N x 4 quaternions of R_enu_imu."""
    return rotations.from_matrices(kitti_raw.orientations(oxts))


def _diagonal(variances: np.ndarray) -> list:
    return np.diag(variances).reshape(-1).tolist()
