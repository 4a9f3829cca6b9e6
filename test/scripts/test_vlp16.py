"""The VLP-16 decoder against points worked out one by one from the user manual's formulas."""

import math

import numpy as np
import pytest
from vlp16_packets import packet

from fdi_lio_scripts import vlp16
from fdi_lio_scripts.errors import UserError
from fdi_lio_scripts.vlp16 import DecodeCounts, decode_scan

ANGLES = [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15]  # degrees, of lasers 0 .. 15
HEIGHTS_MM = [11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2]


def only(block, firing, laser, distance=2500, reflectivity=77):
    """A shot function with a single return."""
    return lambda b, f, l: (distance, reflectivity) if (b, f, l) == (block, firing, laser) else (0, 0)


@pytest.mark.parametrize(
    "block, firing, laser", [(0, 0, 0), (0, 0, 15), (0, 1, 0), (3, 1, 7), (11, 0, 4), (11, 1, 15)]
)
def test_single_point_by_hand(block, firing, laser):
    counts = DecodeCounts()
    points, stamp = decode_scan([(5 * 10**9, packet(3000, 20, only(block, firing, laser)))], counts)
    assert stamp == 5 * 10**9 and len(points) == 1 and counts.points == 1
    assert counts.no_return == 12 * 2 * 16 - 1
    seconds = block * 110.592e-6 + firing * 55.296e-6 + laser * 2.304e-6
    azimuth = math.radians(30.0 + 0.2 * block + 0.2 * (firing * 55.296 + laser * 2.304) / 110.592)
    elevation = math.radians(ANGLES[laser])
    expected = (
        5.0 * math.cos(elevation) * math.cos(azimuth),
        -5.0 * math.cos(elevation) * math.sin(azimuth),  # the azimuth is clockwise: to the right, y < 0
        5.0 * math.sin(elevation) + 1e-3 * HEIGHTS_MM[laser],
    )
    point = points[0]
    np.testing.assert_allclose([point["x"], point["y"], point["z"]], expected, atol=1e-6)
    assert point["time"] == pytest.approx(seconds, abs=1e-9)
    assert point["ring"] == (ANGLES[laser] + 15) // 2
    assert point["intensity"] == 77


def test_azimuth_interpolates_across_north():
    points, _ = decode_scan([(0, packet(35990, 20, only(0, 1, 0)))], DecodeCounts())
    azimuth = math.degrees(math.atan2(-points["y"][0], points["x"][0]))
    assert azimuth == pytest.approx(-0.10 + 0.1, abs=1e-5)


def test_known_cylinder_comes_back_within_quantisation():
    # A wall at 8 m all around: distance grows with the elevation; a whole turn in 76 packets.
    def shot(_block, _firing, laser):
        return round(8.0 / math.cos(math.radians(ANGLES[laser])) / 0.002), 100

    packets = [(i * 1_327_104, packet((i * 12 * 40) % 36000, 40, shot)) for i in range(75)]
    points, _ = decode_scan(packets, DecodeCounts())
    assert len(points) == 75 * 384
    np.testing.assert_allclose(np.hypot(points["x"], points["y"]), 8.0, atol=0.0011)
    assert np.all(np.diff(points["time"]) >= 0)
    # clockwise: the angle falls steadily with time, one turn in all
    angle = np.unwrap(np.arctan2(points["y"], points["x"])[points["ring"] == 8])
    assert np.all(np.diff(angle) < 0) and angle[0] - angle[-1] == pytest.approx(2 * np.pi, abs=0.01)
    assert points["time"].max() == pytest.approx(75 * 1.327104e-3, abs=6e-5)
    assert np.bincount(points["ring"]).tolist() == [75 * 24] * 16


def test_dual_returns_keep_the_stronger_one():
    def shot(block, _firing, laser):
        if laser == 0:  # last is weaker than the strongest
            return (4000, 10) if block % 2 == 0 else (2000, 90)
        if laser == 1:  # last is the strongest; the other block holds the second strongest
            return (4000, 90) if block % 2 == 0 else (2000, 10)
        if laser == 2:  # one return: both blocks hold it
            return 3000, 50
        if laser == 3:  # only the second block has one
            return (0, 0) if block % 2 == 0 else (1000, 5)
        return 0, 0

    counts = DecodeCounts()
    points, _ = decode_scan([(0, packet(0, 20, shot, mode=0x39, pair=True))], counts)
    distance = np.linalg.norm([points["x"], points["y"], points["z"]], axis=0)
    for laser, expected in ((0, 4.0), (1, 8.0), (2, 6.0), (3, 2.0)):
        mine = points["ring"] == (ANGLES[laser] + 15) // 2
        np.testing.assert_allclose(distance[mine], expected, atol=0.012)
        assert mine.sum() == 12  # 6 pairs of blocks, 2 firings each
    # six blocks in time, not twelve
    assert points["time"].max() == pytest.approx(5 * 110.592e-6 + 55.296e-6 + 3 * 2.304e-6, abs=1e-9)
    assert counts.dual_packets == 1


def test_bad_blocks_and_packets_are_counted():
    data = bytearray(packet(0, 20, lambda *_: (2500, 1)))
    data[100:102] = b"\x00\x00"  # flag of block 1
    data[202:204] = b"\xff\xff"  # azimuth of block 2
    counts = DecodeCounts()
    points, _ = decode_scan([(0, bytes(data)), (10**6, b"short")], counts)
    assert len(points) == 10 * 32
    assert (counts.bad_blocks, counts.bad_packets) == (2, 1)
    # block 0 still turns as usual although its neighbour is bad
    last = points[(points["ring"] == 15) & (points["time"] < 100e-6)][-1]
    expected = 0.2 * (55.296 + 15 * 2.304) / 110.592
    assert math.degrees(math.atan2(-last["y"], last["x"])) == pytest.approx(expected, abs=1e-4)


def test_other_sensors_are_refused():
    with pytest.raises(UserError, match="VLP-32C"):
        decode_scan([(0, packet(0, 20, lambda *_: (1, 1), product=0x28))], DecodeCounts())


def test_no_packets_give_no_points():
    points, _ = decode_scan([], DecodeCounts())
    assert len(points) == 0


def test_rings_are_in_order_of_elevation():
    order = np.argsort(vlp16.RING_OF_LASER)
    assert np.all(np.diff(vlp16.VERTICAL_ANGLE_DEG[order]) == 2.0)
