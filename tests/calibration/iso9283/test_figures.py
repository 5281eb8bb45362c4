"""What a test after ISO 9283 gives: names, numbers of cycles, best fits, coverage."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.calibration.iso9283.figures import (
    PathReadings,
    PoseReadings,
    is_centred,
    iso_figures,
    jackknife,
    tangents,
)

NAMES = ("P1", "P2", "P3", "P4", "P5")
PLACES = np.array([[0, 0, 0], [1, 1, 1], [-1, 1, -1], [-1, -1, -1], [1, -1, 1.0]])
ERRORS = 1e-3 * np.array(
    [[1.0, 0.2, 0.1], [0.8, 0.3, -0.2], [1.3, 0.1, 0.4], [0.9, 0.5, 0.2], [1.2, 0, 0]]
)


def test_poses_with_known_errors():
    poses = readings()
    found = by_name(iso_figures(poses))
    for name, place, error in zip(NAMES, PLACES, ERRORS, strict=True):
        value = found["AP", name]
        assert value.size == pytest.approx(np.linalg.norm(error), abs=4e-5)
        assert value.count == 30 and not value.remark
        assert 0.0 < value.uncertainty < 3e-5
        np.testing.assert_allclose(iso_figures(poses).positions[name], place)
    gap = np.linalg.norm(PLACES[1] + ERRORS[1] - PLACES[3] - ERRORS[3])
    commanded = np.linalg.norm(PLACES[1] - PLACES[3])
    assert found["AD", "P2 to P4"].size == pytest.approx(gap - commanded, abs=2e-5)


def readings(cycles=30, size=2e-5, seed=5601, error=ERRORS):
    rng = np.random.default_rng(seed)
    pose = np.tile(np.arange(5), cycles)
    noise = size * rng.normal(size=(len(pose), 3))
    return PoseReadings(
        tuple(NAMES[k] for k in pose),
        ("",) * len(pose),
        np.repeat(np.arange(1, cycles + 1), 5),
        PLACES[pose],
        PLACES[pose] + error[pose] + noise,
        np.full(len(pose), np.nan),
    )


def by_name(figures):
    return {(value.name, value.place): value for value in figures.values}


@pytest.mark.parametrize(("cycles", "iso"), [(2, False), (29, False), (30, True)])
def test_fewer_cycles_give_no_iso_value(cycles, iso):
    for value in iso_figures(readings(cycles)).values:
        assert (not value.remark) == iso
        if not iso:
            assert value.remark == f"not an ISO value: {cycles} of 30 cycles"


def test_one_cycle_gives_no_repeatability():
    names = {value.name for value in iso_figures(readings(1)).values}
    assert names == {"AP", "AD"}


def test_two_visits_make_rp_look_small():
    """What the remark is for: RP of two visits is the half distance between them."""
    rp = [by_name(iso_figures(readings(n)))["RP", "P1"].size for n in (2, 30)]
    assert rp[0] < 0.7 * rp[1]


def test_a_frame_that_was_registered_here_is_named():
    poses = readings()
    figures = iso_figures(poses, fit=True)
    names = {value.name for value in figures.values}
    assert "AP after best fit" in names and "AP" not in names and figures.best_fit
    plain, fitted = iso_figures(poses), figures
    assert _mean(fitted, "AP after best fit") < _mean(plain, "AP")
    for name in ("RP", "AD", "RD"):  # a rigid motion leaves distances as they are
        assert _mean(fitted, name) == pytest.approx(_mean(plain, name), abs=1e-9)


def _mean(figures, name):
    return np.mean([value.size for value in figures.values if value.name == name])


def test_a_frame_that_was_registered_before_shows_by_the_mean_error():
    poses = readings(error=ERRORS - ERRORS.mean(axis=0), size=1e-6)
    assert is_centred(poses)
    assert "AP" not in {value.name for value in iso_figures(poses).values}
    assert not is_centred(readings())


def test_three_directions_give_vap():
    poses = readings()
    sides = np.array(["x", "y", "z"])
    offset = 1e-3 * np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.4, 0]])
    which = (poses.cycle - 1) % 3
    turned = PoseReadings(
        poses.pose, tuple(sides[which].tolist()), (poses.cycle - 1) // 3,
        poses.command, poses.position + offset[which], poses.time,
    )  # fmt: skip
    found = by_name(iso_figures(turned))["vAP", "P1"]
    assert found.size == pytest.approx(5e-4, abs=3e-5) and found.count == 10
    two = iso_figures(
        PoseReadings(
            turned.pose,
            tuple("xxy"[k] for k in which),
            np.arange(len(which)),
            turned.command,
            turned.position,
            turned.time,
        )
    )
    assert "2 of 3 directions" in by_name(two)["vAP", "P1"].remark


def test_drift_needs_time_and_is_no_iso_value_below_eight_hours():
    poses = readings(40)
    for hours, remark in ((8.1, ""), (4.0, "not an ISO value: over 4.0 of 8 h")):
        time = np.repeat(np.linspace(0, 3600 * hours, 40), 5)
        late = poses.position + (np.arange(200) // 100 * 3e-4)[:, None] * [1, 0, 0]
        moved = PoseReadings(
            poses.pose, poses.direction, poses.cycle, poses.command, late, time
        )
        value = next(v for v in iso_figures(moved).values if v.name == "dAP")
        assert value.size == pytest.approx(3e-4, abs=3e-5) and value.remark == remark
    assert all(v.name != "dAP" for v in iso_figures(poses).values)


S = np.linspace(0, 2, 41)
LEGS = np.where(S[:, None] <= 1, S[:, None] * [1.0, 0, 0], [[1.0, 0, 0]])
LEGS = LEGS + np.maximum(S - 1, 0.0)[:, None] * [0, 1.0, 0]


def path(cycles=10, off=(0, 0, 1e-3), size=0.0, seed=5602):
    rng = np.random.default_rng(seed)
    tracks = [LEGS + off + size * rng.normal(size=(41, 3)) for _ in range(cycles)]
    return PathReadings("L", S, LEGS, tuple((S, track) for track in tracks))


def test_paths_and_their_corners():
    found = by_name(iso_figures(None, (path(),)))
    assert found["AT", "L"].size == pytest.approx(1e-3, abs=1e-9)
    assert found["RT", "L"].size == pytest.approx(0.0, abs=1e-9)
    assert found["CR", "L at 1000 mm"].size == pytest.approx(1e-3, abs=1e-9)
    assert found["CO", "L at 1000 mm"].size == pytest.approx(0.0, abs=1e-9)
    assert not any(value.remark for value in found.values())
    few = by_name(iso_figures(None, (path(5),)))
    assert few["AT", "L"].remark == "not an ISO value: 5 of 10 cycles"
    assert not few["CR", "L at 1000 mm"].remark
    assert by_name(iso_figures(None, (path(2),)))["CR", "L at 1000 mm"].remark


def test_only_the_corner_is_one():
    _, corner = tangents(path())
    np.testing.assert_array_equal(np.flatnonzero(corner), [20])


def test_the_uncertainty_holds_the_truth_as_often_as_it_says():
    """95 % intervals of AP and RP over 300 drawn tests of 30 cycles."""
    rng = np.random.default_rng(5603)
    inside = 0
    for _ in range(300):
        points = np.array([1e-3, 0, 0]) + 2e-5 * rng.normal(size=(30, 3))
        half = jackknife(30, lambda k, p=points: np.linalg.norm(p[k].mean(axis=0)))
        inside += abs(np.linalg.norm(points.mean(axis=0)) - 1e-3) <= half
    assert 0.91 <= inside / 300 <= 0.985
    assert np.isnan(jackknife(2, lambda k: 0.0))
