"""Every imperfection: its size, what it depends on, and its shape."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from postproc.exceptions import PostprocError
from postproc.simulation import (
    NAMES,
    NJ220,
    Planted,
    VirtualArm,
    make_arrivals,
    virtual_arm,
)
from postproc.simulation.laws import AS_BUILT, KINDS, Where
from postproc.simulation.reference import PROBE, reference_arrivals
from tests.slow import slow

REFERENCE = reference_arrivals(400)


@cache
def arm_with(name: str, seed: int = 1, **more) -> VirtualArm:
    return virtual_arm(seed, [Planted(name, **more)])


def displacement(arm: VirtualArm, arrivals=REFERENCE) -> np.ndarray:
    return arm.simulate_readings(arrivals, arm.tcp(arrivals)) - arm.nominal_tcp(
        arrivals
    )


@cache
def usual(name: str) -> np.ndarray:
    """How far one effect, of 0.2 mm at most, moves the tool."""
    return displacement(arm_with(name, peak_mm=0.2))


def angle_error(arm: VirtualArm, joint: int, **changes) -> np.ndarray:
    arrivals = replace(REFERENCE, **changes)
    return arm.laws[0](arrivals)[:, joint - 1]


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("seed", [0, *slow([1, 2, 3])])
def test_the_peak_is_what_was_asked_for(name: str, seed: int) -> None:
    away = displacement(arm_with(name, seed, peak_mm=0.2))
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(0.2e-3, rel=1e-3)


@pytest.mark.parametrize("arms", [10, *slow([30])])
@pytest.mark.parametrize("name", KINDS)
def test_the_usual_size_lies_in_the_usual_range(name: str, arms: int) -> None:
    sizes = [arm_with(name, seed).laws[0].peak_mm for seed in range(arms)]
    assert KINDS[name].low_mm <= min(sizes) < max(sizes) <= KINDS[name].high_mm
    assert np.std(sizes) > 0


# What each law may depend on besides the joint angles.
COVARIATES = {
    "compliance": {"payload"}, "bending": {"payload"}, "payload": {"payload"},
    "counterbalance": set(), "transmission": set(), "transmission_free": set(),
    "scale": set(),
    "coupling": set(), "worn_spot": set(), "joint_product": set(),
    "motor_wave": set(), "drive_wave": set(), "drive_backlash": {"flank"},
    "backlash": {"flank"}, "load_backlash": {"flank", "payload"},
    "gravity_side": {"payload"}, "windup": {"flank", "travel"},
    "lag": {"flank", "speed"}, "hysteresis": {"flank", "travel", "loop"},
    "thermal": {"temperature"}, "warmup": {"time"}, "base_shift": {"order"},
    "tool_shift": {"order"}, "tracker_drift": {"time"}, "joint_step": {"order"},
    "base_tilt": {"payload"}, "elastic_flank": {"flank", "travel", "loop"},
    "azimuth": set(), "refraction": set(), "joint_offset": set(),
}  # fmt: skip
OTHER = {
    "flank": -REFERENCE.flank,
    "travel": REFERENCE.travel * 0.5,
    "loop": REFERENCE.loop * 0.5,
    "speed": REFERENCE.speed + 0.1,
    "time": REFERENCE.time + 300.0,
    "temperature": REFERENCE.temperature + 1.0,
    "payload": REFERENCE.payload + 10.0,
    "order": REFERENCE.order + 150.0,
}


@pytest.mark.parametrize("name", COVARIATES)
@pytest.mark.parametrize("covariate", OTHER)
def test_a_law_depends_on_its_covariates_and_on_nothing_else(name, covariate) -> None:
    arm = arm_with(name, peak_mm=0.2)
    changed = replace(REFERENCE, **{covariate: OTHER[covariate]})
    moved = np.abs(displacement(arm, changed) - usual(name)).max()
    if covariate in COVARIATES[name]:
        assert moved > 1e-7
    else:
        assert moved == 0.0


def test_every_law_is_listed_here() -> None:
    assert set(COVARIATES) | set(AS_BUILT) == set(NAMES)


def test_only_the_named_joints_are_moved() -> None:
    for name in COVARIATES:
        law = arm_with(name).laws[0]
        moved = np.abs(law(REFERENCE)).max(axis=0) > 0
        if law.where is Where.JOINTS:
            assert tuple(np.flatnonzero(moved) + 1) == tuple(sorted(law.joints))


def test_backlash_changes_sign_with_the_side_and_size_with_the_angle() -> None:
    arm = arm_with("backlash")
    forward = arm.laws[0](replace(REFERENCE, side=np.ones((400, 6))))
    back = arm.laws[0](replace(REFERENCE, side=-np.ones((400, 6))))
    np.testing.assert_allclose(forward, -back)
    assert (forward < 0).all()  # a link lags behind its motor
    assert (np.abs(forward).max(axis=0) < 0.2e-3 * 1.4).all()
    assert (np.abs(forward).min(axis=0) > 0.05e-3 * 0.6).all()
    assert (np.ptp(forward, axis=0) > 1e-6).all()


def test_bending_leaves_what_stands_before_its_joint() -> None:
    arm = arm_with("bending", joint=5, peak_mm=0.4)
    tool = np.tile(np.eye(4), (len(REFERENCE), 1, 1))
    tool[:, 2, 3] = -NJ220.d[5]  # the wrist's centre, on axes 4, 5 and 6
    at_wrist = replace(REFERENCE, tool=tool)
    assert np.abs(displacement(arm, at_wrist)).max() < 1e-12
    moved = displacement(arm)
    # A rotation about axes across axis 5: nothing moves along what it turns about.
    law = arm.laws[0](REFERENCE).reshape(-1, 6, 6)
    assert (np.abs(law).max(axis=(0, 2)) > 0).tolist() == [False] * 4 + [True, False]
    frames = NJ220.frames(REFERENCE.q)
    turn = np.einsum("nca,na->nc", frames[:, 4, :3, :2], law[:, 4, 3:5])
    tcp = (frames[:, 6] @ REFERENCE.tool)[:, :3, 3]
    wanted = np.cross(turn, tcp - frames[:, 4, :3, 3])
    np.testing.assert_allclose(moved, wanted, atol=1e-6)


def test_compliance_is_torque_over_stiffness() -> None:
    # Twice the payload torque makes twice the change; the links' share stays.
    arm = arm_with("compliance", joint=2)
    nothing, one, two = (
        angle_error(arm, 2, payload=np.full(400, m)) for m in (0.0, 50.0, 100.0)
    )
    np.testing.assert_allclose(two - nothing, 2 * (one - nothing), atol=1e-15)
    assert np.abs(one - nothing).max() > 0


@pytest.mark.parametrize("seed", [0, 1, *slow([2, 3, 4, 5])])
def test_transmission_is_one_wave_of_the_joint(seed: int) -> None:
    for name, orders in (
        ("transmission", {1, 2}),
        ("transmission_free", set(range(7, 31))),
    ):
        arm = arm_with(name, seed)
        law = arm.laws[0]
        order, j = int(law.parameters["order"]), law.joints[0] - 1
        assert order in orders
        q = np.zeros((720, 6))
        q[:, j] = np.arange(720) * 2 * np.pi / 720
        spectrum = np.abs(np.fft.rfft(law(make_arrivals(q))[:, j]))
        assert np.argmax(spectrum) == order
        assert np.delete(spectrum, order).max() < 1e-9 * spectrum[order]


def test_scale_and_coupling_are_straight_lines() -> None:
    for name in ("scale", "coupling"):
        law = arm_with(name).laws[0]
        source = (law.source or law.joints[0]) - 1
        ratio = law(REFERENCE)[:, law.joints[0] - 1] / REFERENCE.q[:, source]
        np.testing.assert_allclose(ratio, ratio[0])


def test_worn_spot_is_a_narrow_bump() -> None:
    for seed in range(10):
        law = arm_with("worn_spot", seed).laws[0]
        j = law.joints[0] - 1
        away = REFERENCE.q[:, j] - law.parameters["centre"]
        size = np.abs(law(REFERENCE)[:, j])
        assert np.abs(away[np.argmax(size)]) < law.parameters["width"]
        assert (
            size[np.abs(away) > 4 * law.parameters["width"]] < 1e-3 * law.scale
        ).all()


def test_counterbalance_pulls_towards_the_upright() -> None:
    law = arm_with("counterbalance").laws[0]
    q = np.zeros((3, 6))
    q[:, 1] = law.parameters["upright"] + np.array([-0.5, 0.0, 0.5])
    error = law(make_arrivals(q))[:, 1]
    assert error[0] > 0 and error[2] < 0
    np.testing.assert_allclose(error[1], 0.0, atol=1e-18)


def test_gravity_side_saturates() -> None:
    for seed in range(8):
        law = arm_with("gravity_side", seed).laws[0]
        assert np.abs(law(REFERENCE)).max() <= law.scale


def test_windup_turns_over_after_its_way() -> None:
    law = arm_with("windup").laws[0]
    j, way = law.joints[0] - 1, law.parameters["d0"]
    travel = np.outer([0.0, way * np.log(2.0), 50 * way], np.ones(6))
    error = law(make_arrivals(np.zeros((3, 6)), 1.0, travel=travel))[:, j]
    np.testing.assert_allclose(error / law.scale, [1.0, 0.0, -1.0], atol=1e-12)


def test_hysteresis_remembers_two_reversals() -> None:
    law = arm_with("hysteresis").laws[0]
    j = law.joints[0] - 1
    travel, loop = np.full((2, 6), 0.05), np.outer([0.02, 0.4], np.ones(6))
    error = law(make_arrivals(np.zeros((2, 6)), 1.0, travel=travel, loop=loop))[:, j]
    assert abs(error[1]) > 1.5 * abs(error[0])
    assert law.effect == ""


@pytest.mark.parametrize("name", ["base_shift", "tool_shift"])
def test_a_shift_is_one_step(name: str) -> None:
    arm = arm_with(name)
    away = np.linalg.norm(displacement(arm), axis=1)
    row = int(arm.laws[0].parameters["row"])
    assert 80 < row <= 320
    assert (away[:row] == 0).all() and (away[row:] > 0).all()


def test_thermal_growth_is_that_of_metal() -> None:
    for seed in range(20):
        law = arm_with("thermal", seed, peak_mm=0.3).laws[0]
        per_kelvin = law(make_arrivals(np.zeros((1, 6)), temperature=21.0))
        assert (per_kelvin > 0).all() and (per_kelvin < 40e-6).all()
    at_rest = arm_with("thermal").laws[0](make_arrivals(np.zeros((1, 6))))
    np.testing.assert_array_equal(at_rest, 0.0)


def test_tracker_drift_moves_no_arm() -> None:
    arm = arm_with("tracker_drift")
    np.testing.assert_array_equal(arm.error(REFERENCE), 0.0)
    motion = arm.laws[0](REFERENCE)
    np.testing.assert_array_equal(motion[0], 0.0)
    step = np.abs(np.diff(motion, axis=0)).max(axis=0)
    assert (step < 0.03 * np.abs(motion).max(axis=0)).all()  # slow


def test_a_law_that_cannot_be_seen_is_refused() -> None:
    on_axis = np.array([0.0, 0.0, PROBE[2]])
    with pytest.raises(PostprocError, match="does not move"):
        virtual_arm(1, "scale@6", tool=on_axis)
