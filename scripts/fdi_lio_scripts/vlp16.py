"""Decodes packets of a Velodyne VLP-16.

All numbers are of the VLP-16 User Manual (63-9243): chapter 9 for the packet, the timing and the geometry.
Points come out in the axes of the ROS driver: x forward (azimuth 0), y left, z up; the azimuth counts
clockwise.
"""

from dataclasses import dataclass
from typing import List, Sequence, Tuple

import numpy as np

from .errors import UserError
from .ros_messages import VELODYNE_POINT

PACKET_BYTES = 1206
BLOCKS_PER_PACKET = 12
FIRINGS_PER_BLOCK = 2
LASERS = 16
BLOCK_FLAG = 0xEEFF  # the bytes FF EE, little endian
DISTANCE_UNIT_M = 0.002
AZIMUTH_UNIT_DEG = 0.01
AZIMUTH_UNITS_PER_TURN = 36000
FIRING_PERIOD_S = 55.296e-6
LASER_PERIOD_S = 2.304e-6
BLOCK_PERIOD_S = FIRINGS_PER_BLOCK * FIRING_PERIOD_S
# A block turns 0.2 degrees at 10 Hz and 0.4 at 20 Hz. More than this is no turn but a jump.
MAX_BLOCK_TURN_UNITS = 200

RETURN_MODE_STRONGEST, RETURN_MODE_LAST, RETURN_MODE_DUAL = 0x37, 0x38, 0x39
PRODUCT_VLP16 = 0x22
PRODUCT_NAMES = {
    0x21: "HDL-32E", 0x22: "VLP-16", 0x24: "Puck Hi-Res", 0x28: "VLP-32C", 0x31: "Velarray", 0xA1: "VLS-128"
}

# In the order of firing: laser 0, 1, ... 15.
VERTICAL_ANGLE_DEG = np.array(
    [-15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0]
)
# Height of each laser above the sensor's centre, added to z.
VERTICAL_CORRECTION_M = 1e-3 * np.array(
    [11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2]
)
# Ring 0 is the lowest beam.
RING_OF_LASER = np.argsort(np.argsort(VERTICAL_ANGLE_DEG)).astype(np.uint16)

RETURN = np.dtype([("distance", "<u2"), ("reflectivity", "u1")])
BLOCK = np.dtype([("flag", "<u2"), ("azimuth", "<u2"), ("returns", RETURN, (FIRINGS_PER_BLOCK, LASERS))])
PACKET = np.dtype([
    ("blocks", BLOCK, BLOCKS_PER_PACKET), ("time_us", "<u4"), ("return_mode", "u1"), ("product", "u1"),
])
assert PACKET.itemsize == PACKET_BYTES


@dataclass
class DecodeCounts:
    """What became of the measurements of all scans so far."""

    points: int = 0
    no_return: int = 0  # distance 0: nothing came back
    bad_blocks: int = 0  # wrong flag or an azimuth beyond 360 degrees
    bad_packets: int = 0  # not 1206 bytes
    dual_packets: int = 0


def decode_scan(packets: Sequence[Tuple[int, bytes]], counts: DecodeCounts) -> Tuple[np.ndarray, int]:
    """Points of one scan and its stamp in nanoseconds.

    packets: (stamp in ns, bytes); a packet's stamp is the time of its first firing, as the driver takes it.
    The scan's stamp is that of its first packet; `time` counts from there.
    """
    whole = [packet for packet in packets if len(packet[1]) == PACKET_BYTES]
    counts.bad_packets += len(packets) - len(whole)
    if not whole:
        return np.empty(0, dtype=VELODYNE_POINT), packets[0][0] if packets else 0
    data = np.frombuffer(b"".join(packet[1] for packet in whole), dtype=PACKET)
    _check_product(data["product"])
    stamps = np.array([packet[0] for packet in whole], dtype=np.int64)
    stamp_ns = int(stamps.min())
    starts_s = (stamps - stamp_ns) * 1e-9
    dual = data["return_mode"] == RETURN_MODE_DUAL
    counts.dual_packets += int(dual.sum())
    parts: List[np.ndarray] = []
    if (~dual).any():
        parts.append(_decode(data["blocks"][~dual], starts_s[~dual], counts))
    if dual.any():
        parts.append(_decode(strongest_of_pairs(data["blocks"][dual]), starts_s[dual], counts))
    points = np.concatenate(parts)
    return points[np.argsort(points["time"], kind="stable")], stamp_ns


def strongest_of_pairs(blocks: np.ndarray) -> np.ndarray:
    """Packets in dual mode hold two blocks for each azimuth, the last and the strongest return.

    When the last is the strongest, the other block holds the second strongest. So of each pair the return
    with the higher reflectivity is kept, and the last one where both are equal.
    """
    last, other = blocks[:, 0::2], blocks[:, 1::2]
    kept = last.copy()
    stronger = other["returns"]["reflectivity"] > last["returns"]["reflectivity"]
    stronger &= other["returns"]["distance"] > 0
    stronger |= last["returns"]["distance"] == 0
    kept["returns"] = np.where(stronger, other["returns"], last["returns"])
    return kept


def _decode(blocks: np.ndarray, starts_s: np.ndarray, counts: DecodeCounts) -> np.ndarray:
    """Points of packets x blocks, of which each holds two firings of all lasers."""
    good = (blocks["flag"] == BLOCK_FLAG) & (blocks["azimuth"] < AZIMUTH_UNITS_PER_TURN)
    counts.bad_blocks += int((~good).sum())
    laser_time_s = LASER_PERIOD_S * np.arange(LASERS)
    in_block_s = FIRING_PERIOD_S * np.arange(FIRINGS_PER_BLOCK)[:, None] + laser_time_s  # firing x laser
    block_start_s = BLOCK_PERIOD_S * np.arange(blocks.shape[1])
    time_s = starts_s[:, None, None, None] + block_start_s[:, None, None] + in_block_s

    turn = block_turns(blocks["azimuth"].astype(np.int64), good)
    azimuth_units = blocks["azimuth"][..., None, None] + turn[..., None, None] * (in_block_s / BLOCK_PERIOD_S)
    azimuth = np.radians(AZIMUTH_UNIT_DEG * azimuth_units)

    returned = blocks["returns"]["distance"] > 0
    counts.no_return += int((~returned & good[..., None, None]).sum())
    chosen = returned & good[..., None, None]
    counts.points += int(chosen.sum())
    laser = np.broadcast_to(np.arange(LASERS), chosen.shape)[chosen]
    distance = DISTANCE_UNIT_M * blocks["returns"]["distance"][chosen]
    elevation = np.radians(VERTICAL_ANGLE_DEG)[laser]
    horizontal = distance * np.cos(elevation)

    points = np.zeros(len(laser), dtype=VELODYNE_POINT)
    points["x"] = horizontal * np.cos(azimuth[chosen])
    points["y"] = -horizontal * np.sin(azimuth[chosen])
    points["z"] = distance * np.sin(elevation) + VERTICAL_CORRECTION_M[laser]
    points["intensity"] = blocks["returns"]["reflectivity"][chosen]
    points["ring"] = RING_OF_LASER[laser]
    points["time"] = time_s[chosen]
    return points


def block_turns(azimuth: np.ndarray, good: np.ndarray) -> np.ndarray:
    """How far the head turns from each block to the next, in azimuth units: packets x blocks.

    The last block of a packet takes the turn of the one before. Where a neighbour is bad or the azimuth jumps
    (lost packets are between packets, but a bad block is inside), the median of the scan is taken.
    """
    turn = np.diff(azimuth, axis=1) % AZIMUTH_UNITS_PER_TURN
    valid = good[:, 1:] & good[:, :-1] & (turn <= MAX_BLOCK_TURN_UNITS)
    usual = float(np.median(turn[valid])) if valid.any() else 0.0
    turn = np.where(valid, turn, usual)
    return np.concatenate([turn, turn[:, -1:]], axis=1)


def _check_product(products: np.ndarray) -> None:
    """Refuses packets of other sensors. A zero is let through: some recorders do not fill the byte."""
    for product in np.unique(products):
        if product not in (0, PRODUCT_VLP16):
            name = PRODUCT_NAMES.get(int(product), f"product 0x{int(product):02x}")
            raise UserError(
                f"the packets come from a {name}: only the VLP-16 can be decoded; use its own driver"
            )
