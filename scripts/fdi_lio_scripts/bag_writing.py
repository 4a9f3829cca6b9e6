"""Writes a ROS bag under a temporary name, so that a file with the final name is always complete."""

import os
from pathlib import Path
from typing import Any

from .bag_reading import import_rosbag
from .errors import UserError
from .ros_messages import ros_time


class BagWriter:
    """Use in a `with` block. The bag gets its final name when the block ends without an error.

    After an error or Ctrl-C what was written so far stays, closed and readable, as `NAME.active`.
    """

    def __init__(self, path: str, overwrite: bool, compression: str = "none") -> None:
        self._path = Path(path)
        self._active = Path(path + ".active")
        if self._path.exists() and not overwrite:
            raise UserError(f"{path}: exists already: choose another name, or give --overwrite")
        if not self._path.resolve().parent.is_dir():
            raise UserError(f"{path}: its folder does not exist: make it first")
        self._bag = import_rosbag().Bag(str(self._active), "w", compression=compression)

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, error: Any, *_: Any) -> None:
        self._bag.close()
        if error is None:
            os.replace(self._active, self._path)

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Writes a message as if it had been recorded at its stamp."""
        self._bag.write(topic, message, ros_time(stamp_ns))

    def copy(self, topic: str, raw_message: Any, time: Any, connection_header: Any) -> None:
        """Writes a message that was read with raw=True, byte for byte."""
        self._bag.write(topic, raw_message, time, raw=True, connection_header=connection_header)
