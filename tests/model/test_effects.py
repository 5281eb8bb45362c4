"""Every effect by its definition: columns are derivatives of the displacement."""

from __future__ import annotations

import json
from collections import defaultdict

import numpy as np
import pytest

from postproc.exceptions import PostprocError
from postproc.model.covariate import DRIVERS
from postproc.model.effect_sum import Combination
from postproc.model.effects import (
    BY_NAME,
    EFFECTS,
    KNOWN,
    PLACES,
    kind_of,
    propose,
    restore,
)
from postproc.model.effects.effect import (
    Effect,
    Family,
    JointEffect,
    fade,
    fade_turns,
)
from postproc.model.kinematics import ArmStates
from postproc.model.variance import beyond_variance
from tests.calibration.simulator import COUPLED, NJ, PLATE, covariates, random_states

RNG = np.random.default_rng(5)
STATES = covariates(random_states(40, RNG, PLATE), RNG).with_(
    station=np.repeat([0, 1], 20)
)


def variants() -> list[Effect]:
    drives = [name for name in KNOWN if name.startswith("drive_")]
    out = list(propose([name for name in KNOWN if name not in drives], NJ, STATES))
    out += propose(drives, COUPLED, STATES)
    out.append(BY_NAME["thermal"](form="time", time_constant=100.0))
    out.append(BY_NAME["thermal"](form="time", time_constant=9.0, clock="order"))
    out.append(BY_NAME["load_backlash"](form="gravity_side"))
    out.append(BY_NAME["tool_shift"](row=20.0, turns=True))
    out.append(BY_NAME["base_shift"](row=20.0))
    out.append(BY_NAME["joint_step"](row=20.0))
    out.append(BY_NAME["base_tilt"](skew=True))
    out.append(BY_NAME["windup"](form="elastic"))
    out.append(BY_NAME["windup"](form="dahl"))
    out += [
        BY_NAME[name](tracker=(3.0, -2.0, 1.5), **form)
        for name, form in (
            ("azimuth", {}),
            ("refraction", {}),
            ("refraction", {"form": "stretch"}),
            ("refraction", {"told": False}),
        )
    ]
    out.append(BY_NAME["backlash_profile"](constant=True))
    out += [
        BY_NAME["curve"](direction=d, source=s, lower=(low,), upper=(high,))
        for d, s, low, high in (
            ("base shift z", ("time",), 0.0, 400.0),
            ("tool shift x", ("order",), 0.0, 40.0),
            ("joint 2", ("torque 2",), -4e3, 4e3),
        )
    ]
    return out


@pytest.mark.parametrize("effect", variants(), ids=lambda e: e.name)
def test_columns_are_finite_differences_of_the_error(effect: Effect) -> None:
    one = Combination((effect,))
    batch = ArmStates(NJ, STATES)
    rng = np.random.default_rng(1)
    at = rng.standard_normal(len(one.scales)) * one.scales
    columns = one.columns(one.at(batch, at))
    assert columns.shape == (len(STATES), 3, len(one.parameters))
    for k, scale in enumerate(one.scales):
        step = np.zeros(len(at))
        step[k] = 1e-2 * scale
        slope = one.error(batch, at + step) - one.error(batch, at - step)
        slope /= 2 * step[k]
        error = np.abs(slope - columns[:, :, k]).max() * scale
        assert error < 2e-8, one.names[k]  # [m] at one prior scale


UNTURNED = ("probe_turn", "azimuth", "refraction")  # of readings, not of the tool


@pytest.mark.parametrize(
    "effect", [e for e in variants() if e.name not in UNTURNED], ids=lambda e: e.name
)
def test_rotation_columns_are_what_other_points_of_the_tool_show(
    effect: Effect,
) -> None:
    """A rigid tool: the error at t + d differs from that at t by turn x R d."""
    one, rng = Combination((effect,)), np.random.default_rng(2)
    at = rng.standard_normal(len(one.scales)) * one.scales
    load = np.tile([0.0, 0.0, 0.1], (len(STATES), 1))
    states = STATES.with_(payload_com=load)
    turns = one.rotation_columns(one.at(ArmStates(NJ, states), at))
    for d in 0.2 * np.eye(3):
        other = states.with_(tool=states.tool + d)
        here, there = (one.at(ArmStates(NJ, s), at) for s in (states, other))
        moved = one.columns(there) - one.columns(here)
        lever = (there.walk.tcp - here.walk.tcp)[:, :, None]
        gap = moved - np.cross(turns, lever, axis=1)
        assert np.abs(gap).max(axis=(0, 1)) @ one.scales < 1e-9 * len(one.scales)


def test_a_sum_of_effects_turns_the_tool_as_its_columns_say() -> None:
    names = ("geometry", "backlash", "compliance", "tracker_drift", "registration")
    all_, batch = Combination(propose(names, NJ, STATES)), ArmStates(NJ, STATES)
    at = np.random.default_rng(3).standard_normal(len(all_.scales)) * all_.scales
    columns = all_.rotation_columns(all_.at(batch, at))
    for k, scale in enumerate(all_.scales):
        step = 1e-2 * scale * np.eye(len(at))[k]
        slope = all_.turn(batch, at + step) - all_.turn(batch, at - step)
        gap = slope / (2e-2 * scale) - columns[:, :, k]
        assert np.abs(gap).max() * scale < 2e-5, all_.names[k]  # [rad], products


@pytest.mark.parametrize("form", ["bend", "stretch"])
def test_refraction_seen_from_anywhere_differs_by_a_shift(form: str) -> None:
    """Size, and size times place, make the beam's error but for a constant."""
    batch, place = ArmStates(NJ, STATES), (3.0, -2.0, 1.5)
    told = BY_NAME["refraction"](place, form=form).columns(batch)[:, :, 0]
    anywhere = BY_NAME["refraction"](told=False, form=form).columns(batch)
    apart = anywhere @ np.array([1.0, *place]) - told
    assert np.abs(apart - apart.mean(axis=0)).max() < 1e-12


@pytest.mark.parametrize("effect", variants(), ids=lambda e: e.name)
def test_settings_survive_a_model_file(effect: Effect) -> None:
    plain = json.loads(json.dumps(effect.settings(), allow_nan=False))
    again = restore(effect.name, plain)
    assert again == effect
    assert again.parameters() == effect.parameters()
    names = [p.name for p in effect.parameters()]
    assert len(set(names)) == len(names)


def test_origins_say_what_may_be_compensated() -> None:
    origin = {e.name: e.belongs_to() for e in propose(KNOWN, COUPLED, STATES)}
    del origin["curve"]
    assert {n for n, o in origin.items() if o == "setup"} == {
        "base_shift", "station_shift", "tool_shift", "joint_step", "tracker_drift",
        "azimuth", "refraction", "probe", "probe_turn", "registration",
    }  # fmt: skip
    assert {n for n, o in origin.items() if o == "state"} == {"payload", "thermal"}
    curve = BY_NAME["curve"]
    assert curve(source=("order",)).belongs_to() == "setup"
    assert curve(source=("joint 3", "temperature")).belongs_to() == "state"
    assert curve(source=("joint 3",)).belongs_to() == "arm"
    assert curve(direction="tool shift z", source=("joint 3",)).belongs_to() == "arm"
    # Along the base's axes it may be the tracker that errs.
    assert curve(direction="base shift z", source=("joint 3",)).belongs_to() == "setup"
    # Programs run warm; only the rows of a survey are early in their order.
    by_order = BY_NAME["thermal"](form="time", clock="order")
    assert by_order.belongs_to() == "setup"
    assert BY_NAME["thermal"]().requires() == ("temperature",)
    assert BY_NAME["thermal"](form="time").requires() == ()


@pytest.mark.parametrize("kind", EFFECTS, ids=lambda kind: kind.name)
def test_what_a_search_tries_of_an_effect_is_that_effect(kind: type[Effect]) -> None:
    batch, shares = ArmStates(NJ, STATES), defaultdict[Family, float](float)
    for c in kind.candidates(batch):
        assert c.family.effect == kind.name
        assert {p.joint for p in c.effect.parameters()} == {c.family.joint}
        assert np.isfinite(c.driver(batch)).all()
        finer = c.effect.refine(np.linspace(-1.0, 1.0, 9), batch)
        assert {type(e) for e in (c.effect, c.effect.plainer(), *finer)} == {kind}
        shares[c.family] += np.exp(c.log_prior)
    assert np.allclose(list(shares.values()), 1.0)
    assert kind.driven_by in DRIVERS
    if kind.variation_of is not None:
        joints = {f.joint for f in shares}
        plain = BY_NAME[kind.variation_of].candidates(batch)
        assert joints <= {c.family.joint for c in plain}


def test_an_effect_without_its_covariate_is_refused() -> None:
    bare = random_states(10, RNG)
    with pytest.raises(PostprocError, match="payload needs the payload"):
        propose(["payload"], NJ, bare)
    with pytest.raises(PostprocError, match="no effect 'gravity'"):
        propose(["gravity"], NJ, bare)


def test_free_forms_fade_outside_the_survey() -> None:
    low, high = STATES.q.min(axis=0), STATES.q.max(axis=0)
    far = STATES.with_(q=np.where(STATES.q > 0, high + 1.0, low - 1.0))
    for name in ("elm", "joint_map"):
        effect = propose([name], NJ, STATES)[0]
        assert np.abs(effect.columns(ArmStates(NJ, STATES))).max() > 0
        assert np.abs(effect.columns(ArmStates(NJ, far))).max() < 1e-6
    x = np.linspace(-1, 2, 301)
    f = fade(x, np.array(0.0), np.array(1.0))
    assert (np.diff(f[x >= 0.5]) <= 0).all() and (f[(x >= 0) & (x <= 1)] == 1).all()


def test_joint_errors_are_their_basis_times_the_parameters() -> None:
    for effect in (e for e in variants() if isinstance(e, JointEffect)):
        batch, acts_on = ArmStates(NJ, STATES), effect.acts_on()
        p = np.random.default_rng(4).standard_normal(len(acts_on))
        wanted = np.zeros((len(STATES), 6))
        for k, column in enumerate((effect.basis(batch) * p).T):
            wanted[:, acts_on[k]] += column
        assert np.allclose(effect.angles(batch, p), wanted, rtol=0, atol=1e-13)
        none = ArmStates(NJ, STATES[:0])
        assert effect.basis(none).shape == (0, len(p))
        assert effect.angles(none, p).shape == (0, 6)


def test_a_profile_of_some_joints_is_its_harmonics_as_far_as_surveyed() -> None:
    low, high = np.full(6, -1.0), np.full(6, 1.5)
    effect = BY_NAME["backlash_profile"](
        joints=(2, 5), orders=(4, 1), constant=True, lower=tuple(low), upper=tuple(high)
    )
    q, direction = STATES.q, STATES.direction
    inside = fade_turns(q, low, high)
    assert 0 < (inside < 1).sum() < inside.size
    wanted = [
        direction[:, j] * part
        for j in (1, 4)
        for part in (
            np.ones(len(q)),
            inside[:, j] * np.sin(4 * q[:, j]), inside[:, j] * np.cos(4 * q[:, j]),
            inside[:, j] * np.sin(q[:, j]), inside[:, j] * np.cos(q[:, j]),
        )
    ]  # fmt: skip
    basis = effect.basis(ArmStates(NJ, STATES))
    assert np.allclose(basis, np.stack(wanted, axis=1), rtol=0, atol=1e-14)


def test_an_angle_fades_as_its_nearest_turn_does() -> None:
    low, high = np.array([-1.0, -3.1, 0.0]), np.array([1.0, 3.1, 2.0])
    q = np.random.default_rng(6).uniform(-9.0, 9.0, (200, 3))
    near = (low + high) / 2 + np.mod(q - (low + high) / 2 + np.pi, 2 * np.pi) - np.pi
    wanted = np.where([False, True, False], 1.0, fade(near, low, high))
    assert np.array_equal(fade_turns(q, low, high), wanted)
    assert np.isnan(fade_turns(np.array([[np.nan, 0.0, 0.0]]), low, high)[0, 0])


def test_what_is_known_once_serves_the_same_poses_alone() -> None:
    effect = BY_NAME["backlash_profile"].propose(NJ, STATES)
    one, p = Combination((effect,)), RNG.standard_normal(len(effect.parameters()))
    batch = ArmStates(NJ, STATES)
    effect.angles(batch, p)
    for other in (
        batch.arriving(-STATES.direction),
        batch.move(one.deviation(p), one.shift(batch, p)),
        batch[np.array([7, 3])],
    ):
        fresh = effect.angles(ArmStates(NJ, other.states), p)
        np.testing.assert_array_equal(effect.angles(other, p), fresh)


def test_a_spline_is_as_unsure_as_its_prior_where_it_has_ended() -> None:
    (effect,) = propose(["joint_spline"], NJ, STATES)
    prior = np.array([1e-4 if " 60.0 deg" in p.name else 5e-5
                      for p in effect.parameters()])  # fmt: skip
    inside = effect.beyond(ArmStates(NJ, STATES), prior)
    assert inside is not None and not inside.any()
    q = STATES.q.copy()
    q[:, 1] = effect.upper[1] + 2.0
    far = ArmStates(NJ, STATES.with_(q=q))
    found = effect.beyond(far, prior)
    assert found is not None
    np.testing.assert_allclose(found[:, 1], 5e-5**2)  # the long one goes on
    assert not np.delete(found, 1, axis=1).any()
    both = Combination((*propose(["backlash"], NJ, STATES), effect))
    spread = np.concatenate([np.ones(len(both.scales) - len(prior)), prior])
    moved = beyond_variance(both, far, spread)
    np.testing.assert_allclose(moved, far.jacobian[:, :, 1] ** 2 * found[:, [1]])


def test_every_effect_is_listed_by_its_own_name() -> None:
    assert [kind_of(name).name for name in PLACES] == list(PLACES)
    assert tuple(map(kind_of, PLACES)) == EFFECTS
    assert list(BY_NAME) == list(PLACES)
    with pytest.raises(KeyError):
        kind_of("nonsense")
