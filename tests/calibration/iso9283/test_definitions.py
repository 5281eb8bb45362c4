"""The figures of ISO 9283 against their formulas, written down plainly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from postproc.calibration.iso9283 import definitions as iso

RNG = np.random.default_rng(560)
COMMAND = np.array([1.2, -0.4, 0.9])


def cloud(n=30, centre=COMMAND, size=1e-3):
    return centre + size * RNG.normal(size=(n, 3))


def mean_of(points):
    return [sum(float(p[k]) for p in points) / len(points) for k in range(3)]


def distance(a, b):
    return math.sqrt(sum((float(x) - float(y)) ** 2 for x, y in zip(a, b, strict=True)))


def spread(values):
    mean = sum(values) / len(values)
    return math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1))


def rp(points):
    lengths = [distance(p, mean_of(points)) for p in points]
    return sum(lengths) / len(lengths) + 3 * spread(lengths)


def test_ap_and_rp():
    for n in (2, 5, 30):
        points = cloud(n)
        expected = distance(mean_of(points), COMMAND)
        assert iso.pose_accuracy(COMMAND, points) == pytest.approx(expected, abs=1e-9)
        assert iso.repeatability(points) == pytest.approx(rp(points), abs=1e-9)


def test_rp_of_a_known_cloud():
    """Four points in a square of half diagonal 1 mm: no spread of the distances."""
    square = COMMAND + 1e-3 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]])
    assert iso.repeatability(square) == pytest.approx(1e-3, abs=1e-12)
    assert iso.pose_accuracy(COMMAND, square) == pytest.approx(0.0, abs=1e-12)


def test_vap_is_the_largest_distance_between_means():
    centres = RNG.normal(size=(3, 3))
    expected = max(distance(a, b) for a in centres for b in centres)
    assert iso.variation(centres) == pytest.approx(expected, abs=1e-9)


def test_ad_has_a_sign_and_rd_is_three_standard_deviations():
    first, second = cloud(), cloud(centre=COMMAND + np.array([0.5, 0.0, 0.0]))
    each = [distance(a, b) for a, b in zip(first, second, strict=True)]
    mean = sum(each) / len(each)
    for commanded in (0.4, 0.6):
        found = iso.distance_accuracy(first, second, commanded)
        assert found == pytest.approx(mean - commanded, abs=1e-9)
    rd = iso.distance_repeatability(first, second)
    assert rd == pytest.approx(3 * spread(each), abs=1e-9)


def test_dap_is_the_largest_change_since_the_first_block():
    blocks = np.array([cloud(10, COMMAND + 1e-3 * k * np.eye(3)[0]) for k in (3, 1, 4)])
    each = [distance(mean_of(block), COMMAND) for block in blocks]
    expected = max(abs(ap - each[0]) for ap in each)
    assert iso.pose_drift(COMMAND, blocks) == pytest.approx(expected, abs=1e-9)


def test_at_and_rt_are_the_largest_over_the_stations():
    command = np.linspace([0, 0, 0], [1, 0, 0], 7)
    crossings = command + 1e-3 * RNG.normal(size=(10, 7, 3))
    crossings[..., 0] = command[:, 0]
    at = max(distance(mean_of(crossings[:, k]), command[k]) for k in range(7))
    rt = max(rp(crossings[:, k]) for k in range(7))
    assert iso.path_accuracy(command, crossings) == pytest.approx(at, abs=1e-9)
    assert iso.path_repeatability(crossings) == pytest.approx(rt, abs=1e-9)


def test_a_path_is_cut_by_normal_planes_between_its_readings():
    command = np.linspace([0, 0, 0], [1, 0, 0], 5)
    normals = np.tile([1.0, 0.0, 0.0], (5, 1))
    track = np.array([[-0.1, 0, 0], [0.35, 0.045, 0], [0.8, 0.0, 0.0]])
    found = iso.cross_planes(command, normals, track)
    np.testing.assert_allclose(found[0], [0, 0.01, 0], atol=1e-9)
    np.testing.assert_allclose(found[1], [0.25, 0.035, 0], atol=1e-9)
    np.testing.assert_allclose(found[2], [0.5, 0.03, 0], atol=1e-9)
    assert np.isnan(found[4]).all()  # the track ends before it
    exact = iso.cross_planes(command, normals, command + 2e-3 * np.eye(3)[1])
    np.testing.assert_allclose(exact - command, np.tile([0, 2e-3, 0], (5, 1)))


def test_a_plane_that_is_passed_twice_is_cut_next_to_the_station():
    track = np.array([[-1, 1, 0], [1, 1, 0], [1, -0.1, 0], [-1, -0.1, 0.0]])
    found = iso.cross_planes(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), track)
    np.testing.assert_allclose(found, [[0, -0.1, 0]], atol=1e-9)


CORNER, INTO, ONWARD = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


def test_cr_of_a_corner_that_is_cut_off():
    track = np.array([[-0.01, 0, 0], [0, 0.01, 0.0]])  # from leg to leg, at 45 deg
    expected = 0.01 / math.sqrt(2)
    assert iso.rounding_error(CORNER, track) == pytest.approx(expected, abs=1e-9)
    assert iso.overshoot(CORNER, INTO, ONWARD, track) == pytest.approx(0.0, abs=1e-12)


def test_co_is_the_largest_deviation_beyond_the_corner():
    track = np.array(
        [[-0.01, 0, 0.009], [0.003, 0.0, 0], [0.004, 0.002, 0.003], [0, 0.02, 0.008]]
    )
    found = iso.overshoot(CORNER, INTO, ONWARD, track)
    assert found == pytest.approx(0.005, abs=1e-9)  # the others are not beyond it
