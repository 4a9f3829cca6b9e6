#!/usr/bin/python3
"""Turns SubT-MRS bags, which hold raw VLP-16 packets, into bags with sensor_msgs/PointCloud2.

  subt_mrs_to_bag.py IN.bag [IN2.bag ...] OUT.bag [--ground-truth truth.csv]

The topic of type velodyne_msgs/VelodyneScan is found by its type; the velodyne packages need not be
installed. Clouds have the fields of the Velodyne driver and are stamped with their first firing. All other
topics are copied byte for byte. With --ground-truth the table is also written as OUT_truth.tum (stamps in s,
ms, us or ns are recognised).
"""

import argparse
from pathlib import Path
from typing import Any, List

from fdi_lio_scripts import errors
from fdi_lio_scripts.bag_reading import open_bag, topics_of_types
from fdi_lio_scripts.bag_writing import BagWriter
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.ground_truth_csv import read_ground_truth_csv
from fdi_lio_scripts.progress import Progress
from fdi_lio_scripts.ros_messages import cloud_message, nanoseconds
from fdi_lio_scripts.trajectory_io import write_tum
from fdi_lio_scripts.vlp16 import DecodeCounts, decode_scan

SCAN_TYPE = "velodyne_msgs/VelodyneScan"


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bags", nargs="+", metavar="BAG", help="input bags, and last the bag to write")
    parser.add_argument("--scan-topic", help="topic of the packets, if there are several")
    parser.add_argument("--points-topic", default="/velodyne_points", help="topic of the clouds")
    parser.add_argument(
        "--skip", nargs="+", default=[], metavar="TOPIC", help="topics not to copy, such as cameras"
    )
    parser.add_argument("--ground-truth", metavar="CSV", help="also write this truth as OUT_truth.tum")
    parser.add_argument("--compression", choices=("none", "lz4", "bz2"), default="none")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing bag")
    arguments = parser.parse_args()
    if len(arguments.bags) < 2:
        parser.error("give at least one input bag and the bag to write")
    arguments.inputs, arguments.output = arguments.bags[:-1], arguments.bags[-1]
    if Path(arguments.output).resolve() in [Path(path).resolve() for path in arguments.inputs]:
        parser.error("the bag to write must not be one of the inputs")
    return arguments


def find_scan_topic(paths: List[str], wanted: str) -> str:
    """The topic of the packets, which must be the same in all bags."""
    found = set()
    for path in paths:
        with open_bag(path) as bag:
            found.update(topics_of_types(bag, [SCAN_TYPE]))
    names = ", ".join(sorted(found)) if found else "none"
    if wanted:
        if wanted not in found:
            raise UserError(
                f"{' '.join(paths)}: topic {wanted} holds no {SCAN_TYPE}; topics that do: {names}"
            )
        return wanted
    if len(found) != 1:
        hint = "choose one with --scan-topic" if found else "are these SubT-MRS bags?"
        raise UserError(f"{' '.join(paths)}: {len(found)} topics of type {SCAN_TYPE} ({names}): {hint}")
    return found.pop()


def in_order_of_time(paths: List[str]) -> List[str]:
    """SubT-MRS splits long recordings; the parts are put in order by the time of their first message."""

    def start(path: str) -> float:
        with open_bag(path) as bag:
            return bag.get_start_time() if bag.get_message_count() else 0.0

    return sorted(paths, key=start)


def convert_bag(
    bag: Any, arguments: argparse.Namespace, scan_topic: str, writer: BagWriter, counts: DecodeCounts
) -> int:
    """Copies one bag, with its packets decoded. Returns the number of scans."""
    scans = 0
    with Progress(bag.get_message_count(), Path(bag.filename).name) as progress:
        for topic, raw, time, header in bag.read_messages(raw=True, return_connection_header=True):
            progress.step()
            if topic == scan_topic:
                message = raw[-1]().deserialize(raw[1])
                packets = [(nanoseconds(packet.stamp), bytes(packet.data)) for packet in message.packets]
                points, stamp_ns = decode_scan(packets, counts)
                if len(packets) == 0:
                    continue
                cloud = cloud_message(points, stamp_ns, message.header.frame_id or "velodyne")
                # recorded when the sweep was over, as the driver would have published it
                writer.write(arguments.points_topic, cloud, nanoseconds(time))
                scans += 1
            elif topic not in arguments.skip and topic != arguments.points_topic:
                writer.copy(topic, raw, time, header)
    return scans


def main() -> int:
    """Converts, reports, writes the truth."""
    arguments = parse_arguments()
    truth = read_ground_truth_csv(arguments.ground_truth) if arguments.ground_truth else None
    scan_topic = find_scan_topic(arguments.inputs, arguments.scan_topic)
    counts = DecodeCounts()
    scans = 0
    with BagWriter(arguments.output, arguments.overwrite, arguments.compression) as writer:
        for path in in_order_of_time(arguments.inputs):
            with open_bag(path) as bag:
                scans += convert_bag(bag, arguments, scan_topic, writer, counts)
    print(
        f"wrote {arguments.output}: {scans} scans of {scan_topic} as {arguments.points_topic}, "
        f"{counts.points} points; "
        f"dropped: {counts.no_return} without return, {counts.bad_blocks} bad blocks, {counts.bad_packets} "
        "bad packets"
    )
    if counts.dual_packets:
        print(
            f"note: {counts.dual_packets} packets hold two returns for each shot: the stronger one was kept"
        )
    if truth is not None:
        path = str(Path(arguments.output).with_suffix("")) + "_truth.tum"
        write_tum(path, *truth, f"ground truth of {Path(arguments.ground_truth).name}")
        print(f"wrote {path}: {len(truth[0])} poses")
    return 0


if __name__ == "__main__":
    errors.run(main)
