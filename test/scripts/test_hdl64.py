"""Ring and time of KITTI points."""

import numpy as np
import pytest
from kitti_files import scan_points

from fdi_lio_scripts import hdl64


def test_rings_count_from_the_lowest_beam():
    scan = scan_points()
    rings, how = hdl64.rings_of(scan[:, :3])
    assert how == "order"
    np.testing.assert_array_equal(rings, np.repeat(np.arange(63, -1, -1), 360))
    assert scan[rings == 0, 2].max() < scan[rings == 63, 2].min()


def test_rings_survive_near_points_that_look_higher():
    # lasers 0.2 m above the origin: at 5 m range every point looks 2.3 degrees higher, six beams' worth
    scan = scan_points(range_m=5.0)
    scan[:, 2] += 0.2
    rings, _ = hdl64.rings_of(scan[:, :3])
    np.testing.assert_array_equal(rings, np.repeat(np.arange(63, -1, -1), 360))


@pytest.mark.parametrize("gone", [[0], [63], [5, 6, 40], list(range(25))])
def test_missing_rings_are_found_by_elevation(gone):
    scan = scan_points()
    truth = np.repeat(np.arange(63, -1, -1), 360)
    kept = ~np.isin(truth, gone)
    rings, how = hdl64.rings_of(scan[kept, :3])
    assert how == f"order, {64 - len(gone)} rings"
    np.testing.assert_array_equal(rings, truth[kept])


def test_points_in_any_order_fall_back_to_elevation():
    scan = scan_points()
    shuffled = np.random.default_rng(2).permutation(len(scan))
    rings, how = hdl64.rings_of(scan[shuffled, :3])
    assert how == "elevation"
    np.testing.assert_array_equal(rings, np.repeat(np.arange(63, -1, -1), 360)[shuffled])


def test_empty_scan():
    rings, _ = hdl64.rings_of(np.empty((0, 3)))
    assert len(rings) == 0 and len(hdl64.sweep_share(np.empty((0, 3)))) == 0


def test_sweep_runs_clockwise_from_behind():
    # just left of straight behind, left, front, right, just right of straight behind
    around = np.array([[-1, 1e-6, 0], [0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, -1e-6, 0]])
    shares = hdl64.sweep_share(around)
    np.testing.assert_allclose(shares, [0, 0.25, 0.5, 0.75, 1], atol=1e-6)
    other_way = hdl64.sweep_share(around, clockwise=False)
    np.testing.assert_allclose(other_way, 1 - shares, atol=1e-6)
    exactly_behind = hdl64.sweep_share(np.array([[-1, 0.0, 0], [-1, -0.0, 0]], dtype=np.float32))
    assert np.all((exactly_behind >= 0) & (exactly_behind < 1))


def test_real_scans_have_64_rings(shared_data):
    from fdi_lio_scripts.kitti_raw import read_scan

    for number in (0, 40):
        scan = read_scan(shared_data / "kitti_2011_09_26" / f"{number:010d}.bin.xz")
        rings, how = hdl64.rings_of(scan[:, :3])
        assert how == "order"
        assert np.bincount(rings).min() > 1000
        # medians of neighbouring beams fall from ring to ring where the ground is seen
        elevation = np.degrees(np.arctan2(scan[:, 2], np.hypot(scan[:, 0], scan[:, 1])))
        medians = np.array([np.median(elevation[rings == ring]) for ring in range(32)])
        assert np.all(np.diff(medians) > 0)
