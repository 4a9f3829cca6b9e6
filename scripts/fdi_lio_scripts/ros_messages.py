"""ROS message classes, and the PointCloud2 layout that the recordings of this package use."""

import os
from functools import lru_cache
from pathlib import Path
from typing import Any, Dict, List

import numpy as np

from .errors import UserError

# The layout of the ROS Velodyne driver: `time` follows `ring` without padding, so a point has 22 bytes.
VELODYNE_POINT = np.dtype({
    "names": ["x", "y", "z", "intensity", "ring", "time"],
    "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
    "offsets": [0, 4, 8, 12, 16, 18],
    "itemsize": 22,
})
FIELD_TYPES = {"<u2": 4, "<f4": 7}  # sensor_msgs/PointField: UINT16, FLOAT32


@lru_cache(maxsize=None)
def message_class(type_name: str) -> Any:
    """The Python class of a message type such as "sensor_msgs/Imu".

    Debian ships the Python classes apart from the definitions (python3-sensor-msgs); where they are missing
    the class is generated from the .msg files, as rosbag does with the definitions in a bag.
    """
    import roslib.message  # pylint: disable=import-outside-toplevel  (only conversions need ROS)

    found = roslib.message.get_message_class(type_name)
    return found if found is not None else _classes_from_definition(type_name)[type_name]


def _classes_from_definition(type_name: str) -> Dict[str, Any]:
    """Generates the classes of a type and of the types inside it from the installed .msg files."""
    import genmsg  # pylint: disable=import-outside-toplevel
    import genpy.dynamic  # pylint: disable=import-outside-toplevel

    context = genmsg.MsgContext.create_default()
    search_path = _definition_folders()
    try:
        spec = genmsg.load_msg_by_type(context, type_name, search_path)
        genmsg.load_depends(context, spec, search_path)
    except genmsg.MsgNotFound:
        raise UserError(f"the ROS message type {type_name} is not installed: run scripts/setup.sh") from None
    return genpy.dynamic.generate_dynamic(type_name, genmsg.compute_full_text(context, spec))


def _definition_folders() -> Dict[str, List[str]]:
    """Folders of .msg files by package, from /usr (Debian), /opt/ros and the sourced workspaces."""
    roots = [Path(root) / "share" for root in os.environ.get("CMAKE_PREFIX_PATH", "").split(":") if root]
    roots += sorted(Path("/opt/ros").glob("*/share")) + [Path("/usr/share")]
    folders: Dict[str, List[str]] = {}
    for root in roots:
        for folder in root.glob("*/msg"):
            folders.setdefault(folder.parent.name, []).append(str(folder))
    return folders


def ros_time(stamp_ns: int) -> Any:
    """A ROS time of integer nanoseconds since 1970."""
    import genpy  # pylint: disable=import-outside-toplevel

    seconds, nanoseconds = divmod(int(stamp_ns), 10**9)
    return genpy.Time(seconds, nanoseconds)


def nanoseconds(time: Any) -> int:
    """Integer nanoseconds of a ROS time."""
    return time.secs * 10**9 + time.nsecs


def cloud_message(points: np.ndarray, stamp_ns: int, frame_id: str) -> Any:
    """A sensor_msgs/PointCloud2 of a structured array; its dtype gives names, offsets and point_step."""
    message = message_class("sensor_msgs/PointCloud2")()
    message.header.stamp = ros_time(stamp_ns)
    message.header.frame_id = frame_id
    message.height = 1
    message.width = len(points)
    for name in points.dtype.names:
        field_type, offset = points.dtype.fields[name][:2]
        field = message_class("sensor_msgs/PointField")()
        field.name, field.offset, field.count = name, offset, 1
        field.datatype = FIELD_TYPES[field_type.str]
        message.fields.append(field)
    message.is_bigendian = False
    message.point_step = points.dtype.itemsize
    message.row_step = message.point_step * message.width
    message.data = points.tobytes()
    message.is_dense = True
    return message


def cloud_points(message: Any) -> np.ndarray:
    """The points of a PointCloud2 with the fields of the Velodyne driver, as a structured array."""
    return np.frombuffer(bytes(message.data), dtype=VELODYNE_POINT)
