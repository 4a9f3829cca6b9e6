"""Writes VLP-16 packets byte by byte, and messages of type velodyne_msgs/VelodyneScan."""

import struct
from typing import Callable, List, Sequence, Tuple

import genpy
import genpy.dynamic

# velodyne_msgs as the ROS driver defines them; the separator is what rosbag stores between definitions.
SEPARATOR = "=" * 80
SCAN_DEFINITION = f"""# Velodyne LIDAR scan packets.

Header           header         # standard ROS message header
VelodynePacket[] packets        # vector of raw packets

{SEPARATOR}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id

{SEPARATOR}
MSG: velodyne_msgs/VelodynePacket
# Raw Velodyne LIDAR packet.

time stamp              # packet timestamp
uint8[1206] data        # packet contents
"""
# (block, firing, laser) -> (distance in 2 mm, reflectivity)
Shot = Callable[[int, int, int], Tuple[int, int]]


def packet(
    first_azimuth: int, turn: int, shot: Shot, mode: int = 0x37, product: int = 0x22, pair: bool = False
) -> bytes:
    """1206 bytes: blocks `turn` hundredths of a degree apart (every two blocks if `pair`, as in dual mode).
    """
    data = b""
    for block in range(12):
        step = block // 2 if pair else block
        data += b"\xff\xee" + struct.pack("<H", (first_azimuth + step * turn) % 36000)
        for firing in range(2):
            for laser in range(16):
                data += struct.pack("<HB", *shot(block, firing, laser))
    return data + struct.pack("<IBB", 123456, mode, product)


def scan_classes() -> dict:
    """The message classes, generated as rosbag does."""
    return genpy.dynamic.generate_dynamic("velodyne_msgs/VelodyneScan", SCAN_DEFINITION)


def scan_message(stamps_and_packets: Sequence[Tuple[int, bytes]], frame_id: str = "velodyne"):
    """A VelodyneScan; like the driver's, its own stamp is that of the last packet."""
    classes = scan_classes()
    message = classes["velodyne_msgs/VelodyneScan"]()
    message.header.frame_id = frame_id
    packets: List[object] = []
    for stamp, data in stamps_and_packets:
        one = classes["velodyne_msgs/VelodynePacket"]()
        one.stamp = genpy.Time(*divmod(stamp, 10**9))
        one.data = data
        packets.append(one)
        message.header.stamp = one.stamp
    message.packets = packets
    return message
