"""Opens ROS bags for reading and turns their faults into messages that say what to do."""

from pathlib import Path
from typing import Any, List, Sequence

from .errors import UserError


def open_bag(path: str) -> Any:
    """A `rosbag.Bag` for reading. It closes itself in a `with` block.

    rosbag builds the messages from the definitions in the bag, so no message package is needed.
    """
    if not Path(path).is_file():
        raise UserError(f"{path}: no such file: check the path")
    rosbag = import_rosbag()
    try:
        return rosbag.Bag(path, "r")
    except rosbag.ROSBagUnindexedException:
        raise UserError(
            f"{path}: the bag has no index (the recorder was killed): run 'rosbag reindex {path}'"
        ) from None
    except rosbag.ROSBagException as error:
        raise UserError(
            f"{path}: is no readable ROS 1 bag ({error}): check the file, or copy it again"
        ) from None


def topics_of_types(bag: Any, types: Sequence[str]) -> List[str]:
    """Names of the topics whose type is one of `types`, in alphabetical order."""
    return sorted(
        name for name, info in bag.get_type_and_topic_info().topics.items() if info.msg_type in types
    )


def import_rosbag() -> Any:
    """rosbag is only needed for bags, so that text files can be judged on machines without ROS."""
    try:
        import rosbag  # pylint: disable=import-outside-toplevel
    except ImportError:
        raise UserError(
            "Python cannot import rosbag: run scripts/setup.sh, and call the script with /usr/bin/python3"
        ) from None
    return rosbag
