"""A seed is an arm; arms are as bad as real ones."""

from dataclasses import replace

import numpy as np

from postproc.simulation import sample_survey, stream, virtual_arm
from postproc.simulation.laws import Where

TRACKER = np.array([4.0, -3.0, 1.5])


def test_a_seed_is_an_arm() -> None:
    one, two, three = (virtual_arm(s, "all") for s in (1, 1, 2))
    a = sample_survey(one, 50)
    np.testing.assert_array_equal(one.tcp(a), two.tcp(a))
    assert np.abs(one.tcp(a) - three.tcp(a)).max() > 1e-4
    first, second = (one.measure(a, TRACKER, stream(7, "x")) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_an_added_effect_leaves_the_others_as_they_were() -> None:
    plain, more = virtual_arm(3), virtual_arm(3, "geometry,tool,backlash,lag,scale")
    np.testing.assert_array_equal(plain.as_built.chain.a, more.as_built.chain.a)
    assert plain.laws[0].parameters == more.laws[0].parameters
    np.testing.assert_array_equal(plain.joint_noise, more.joint_noise)


def test_a_factory_arm_misses_by_one_to_three_millimetres() -> None:
    means = []
    for seed in range(40):
        arm = virtual_arm(seed)
        error = arm.error(sample_survey(arm, 100, seed=seed))
        means.append(1e3 * np.linalg.norm(error, axis=1).mean())
    assert 1.0 < np.percentile(means, 5) and np.percentile(means, 95) < 3.0
    assert np.std(means) > 0.1


def test_without_effects_the_arm_is_its_drawing() -> None:
    arm = virtual_arm(5, "")
    a = sample_survey(arm, 30)
    np.testing.assert_allclose(arm.error(a), 0.0, atol=1e-15)


def test_geometry_alone_does_not_move_the_mount() -> None:
    arm = virtual_arm(5, "geometry")
    np.testing.assert_array_equal(arm.as_built.mount, 0.0)
    assert np.abs(arm.as_built.chain.a - arm.nominal.a).min() > 0.5e-4
    arm = virtual_arm(5, "tool")
    np.testing.assert_array_equal(arm.as_built.base, 0.0)
    shift = np.abs(arm.as_built.mount[:3])
    assert (shift >= 0.3e-3).all() and (shift <= 1e-3).all()


def test_the_mount_belongs_to_the_arm_not_to_the_tool() -> None:
    arm = virtual_arm(5, "tool")
    a = sample_survey(arm, 1, tool=np.zeros(3))
    b = sample_survey(arm, 1, tool=np.array([0.0, 0.0, 1e-9]))
    np.testing.assert_allclose(
        np.linalg.norm(arm.error(a)), np.linalg.norm(arm.as_built.mount[:3]), atol=1e-12
    )
    np.testing.assert_allclose(arm.error(a), arm.error(b), atol=1e-11)


def test_repeatability_is_a_real_arms() -> None:
    for seed in range(8):
        arm = virtual_arm(seed)
        a, rng = sample_survey(arm, 400), stream(seed, "again")
        noise = rng.normal(size=(400, 6)) * arm.joint_noise
        spread = np.linalg.norm(arm.tcp(a, noise) - arm.tcp(a), axis=1)
        assert 0.015e-3 < np.sqrt(np.mean(spread**2)) < 0.06e-3


def test_tracker_noise_grows_with_the_range() -> None:
    arm = virtual_arm(1, "")
    a = sample_survey(arm, 4000)
    arm = virtual_arm(1, "").without_noise()
    np.testing.assert_array_equal(arm.measure(a, TRACKER, stream(0, "x")), arm.tcp(a))
    noisy = replace(arm, tracker_noise=(0.01e-3, 5e-6))
    off = noisy.measure(a, TRACKER, stream(0, "x")) - arm.tcp(a)
    span = np.linalg.norm(arm.tcp(a) - TRACKER, axis=1)
    scaled = off / (0.01e-3 + 5e-6 * span)[:, None]
    assert abs(scaled.std() - 1) < 0.03
    assert abs(scaled.mean()) < 0.03


def test_the_gaps_are_those_of_the_backlash() -> None:
    arm = virtual_arm(4)
    gap = [-arm.laws[0].parameters[f"b_{j}"] for j in range(1, 7)]
    np.testing.assert_allclose(arm.gears.gap, gap)
    np.testing.assert_array_equal(virtual_arm(4, "geometry").gears.gap, arm.gears.gap)
    assert arm.laws[0].where is Where.JOINTS
    assert (arm.gears.gap >= 0.05e-3).all() and (arm.gears.gap <= 0.2e-3).all()


def test_the_arm_warms_up_towards_a_limit() -> None:
    arm = virtual_arm(4)
    T = arm.temperature(np.array([0.0, 600.0, 3600.0, 1e6]), 22.0)
    assert T[0] == 22.0 and (np.diff(T) > 0).all()
    np.testing.assert_allclose(T[3], 22.0 + arm.warming[0])


def test_an_arm_is_the_same_in_a_short_and_in_a_long_campaign() -> None:
    short, long = (virtual_arm(3, "all", rows=n) for n in (120, 900))
    a = sample_survey(short, 20)
    for one, two in zip(short.laws, long.laws, strict=True):
        if "row" in one.parameters:
            assert one.parameters["row"] < 100 < two.parameters["row"]
        else:
            np.testing.assert_array_equal(one(a), two(a))
    np.testing.assert_array_equal(short.joint_noise, long.joint_noise)


def test_a_campaign_stays_within_its_volume_and_fills_it() -> None:
    ends = np.radians([[-20.0, 20], [0, 30], [-90, -60], [10, 50], [30, 60], [0, 5]])
    q = sample_survey(virtual_arm(3), 100, seed=1, within=ends).q
    places = (q - ends[:, 0]) / (ends[:, 1] - ends[:, 0]) * 100
    strata = np.sort(np.floor(places), axis=0)  # a Latin hypercube: one row in each
    assert (strata == np.arange(100)[:, None]).all()
