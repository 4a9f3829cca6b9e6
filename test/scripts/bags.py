"""Reads written bags in the tests."""

from collections import defaultdict
from pathlib import Path
from typing import Any, Dict, List

from fdi_lio_scripts.bag_reading import open_bag


def messages_by_topic(path: Path) -> Dict[str, List[Any]]:
    """All messages of a bag by topic, in order of time."""
    found: Dict[str, List[Any]] = defaultdict(list)
    with open_bag(str(path)) as bag:
        for topic, message, _ in bag.read_messages():
            found[topic].append(message)
    return found
