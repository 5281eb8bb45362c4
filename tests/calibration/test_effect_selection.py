"""What a survey gives evidence for is kept, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.calibration.backward_elimination import keep_needed
from postproc.calibration.diagnosis.held_out import regions
from postproc.calibration.effect_selection import (
    candidates,
    fit_best,
    waves_needed,
)
from postproc.calibration.fit import drifts
from postproc.calibration.regression import fit_effects
from postproc.calibration.report import find
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.effects.joint_spline import SHORTEST, JointSpline
from postproc.model.effects.transmission import Transmission
from postproc.model.kinematics import ArmStates
from postproc.model.model import COMPENSATED
from postproc.robot.state import States
from postproc.simulation import VirtualArm, VirtualArrivals, stream, virtual_arm
from tests.calibration.planted import (
    ARM,
    BASE,
    TRACKER,
    states_of,
    survey,
)
from tests.calibration.simulator import NJ, covariates, random_arm, random_states


def planted(seed: int, add: str) -> tuple[str, ...]:
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    states = random_states(300, rng)
    measured, _ = arm.measure(states, rng)
    J = ArmStates(NJ, states).jacobian
    q = states.q
    if add == "coupling":
        measured = measured + J[:, :, 4] * (8e-5 * q[:, [3]])
    if add == "joint_map":
        bump = np.exp(-0.5 * ((q[:, [2]] + 1.9) / 0.1) ** 2)
        measured = measured + J[:, :, 2] * (2e-4 * bump)
    fit = fit_best(NJ, states, measured, None)
    return tuple(e.name for e in fit.combination.effects)


def test_nothing_is_added_without_evidence() -> None:
    assert planted(0, "") == BASE_EFFECTS
    assert planted(1, "") == BASE_EFFECTS


def test_what_is_there_is_kept() -> None:
    assert planted(2, "coupling") == (*BASE_EFFECTS, "coupling")
    assert {"joint_map", "joint_spline"} & set(planted(3, "joint_map"))


def test_the_tracker_reads_nothing_wrongly_without_evidence() -> None:
    for seed in (3, 4):
        old = survey(virtual_arm(seed, BASE), seed, 300)
        assert names_of(virtual_arm(seed, BASE), old) == BASE_EFFECTS


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["azimuth", "refraction"])
def test_what_a_tracker_reads_wrongly_is_the_set_up_s(kind: str) -> None:
    """Where its place is known it is named, and the arm is not taken to err so."""
    arm = virtual_arm(3, (*BASE, f"{kind}=0.5"))
    old, fresh = survey(arm, 3, 300), survey(arm, 4, 100)
    measured = arm.measure(old, TRACKER, stream(3, "measured"))
    batch = ArmStates(NJ, states_of(fresh))
    true = arm.nominal_tcp(fresh) + arm.error(fresh) - batch.tcp
    left = {}
    for told in (True, False):
        origin = tuple(TRACKER) if told else None
        fit = fit_best(NJ, states_of(old), measured, origin)
        c = fit.combination
        found = [e for e in c.effects if e.name in ("azimuth", "refraction")]
        assert [e.name for e in found] == [kind] * told
        assert not any(e.belongs_to() in COMPENSATED for e in found)
        predicted = c.error(batch, np.where(c.where(*COMPENSATED), fit.values, 0.0))
        left[told] = np.linalg.norm(true - predicted, axis=1).mean()
    assert left[True] < 0.7 * left[False]


def names_of(arm: VirtualArm, old: VirtualArrivals) -> tuple[str, ...]:
    """Name what a fit keeps of a survey whose tracker's place is known."""
    measured = arm.measure(old, TRACKER, stream(7, "measured"))
    fit = fit_best(NJ, states_of(old), measured, tuple(TRACKER))
    return tuple(e.name for e in fit.combination.effects)


@pytest.mark.slow
def test_gravity_shows_beside_waves_that_are_larger() -> None:
    rng = np.random.default_rng(4)
    states = random_states(400, rng)
    measured, _ = random_arm(rng).measure(states, rng)
    batch, q = ArmStates(NJ, states), states.q
    J, torque = batch.jacobian, batch.loads.gravity[:, [2]]
    for j, order in ((0, 11.0), (1, 17.0), (2, 13.0)):
        measured = measured + J[:, :, j] * (3e-4 * np.sin(order * q[:, [j]]))
    measured = measured + J[:, :, 2] * (4e-5 * torque / np.abs(torque).max())
    base = propose(BASE_EFFECTS, NJ, states)
    alone = fit_effects(batch, measured, (*base, *propose(["compliance"], NJ, states)))
    assert "compliance" not in {e.name for e in keep_needed(alone, base)}
    found = fit_best(NJ, states, measured, None).combination.effects
    assert {"compliance", "joint_spline"} <= {e.name for e in found}


def test_an_arm_of_unknown_links_yields_by_the_shapes_of_gravity() -> None:
    bare = replace(NJ, file=NJ.file.model_copy(update={"links": None}))
    rng = np.random.default_rng(6)
    states, held = random_states(300, rng), random_states(200, rng)
    measured, _ = random_arm(rng).measure(states, rng)

    def sag(states: States) -> Floats:
        batch = ArmStates(NJ, states)  # which knows the links
        turned = 3e-7 * batch.loads.gravity[:, 1:3]
        return np.einsum("nij,nj->ni", batch.jacobian[:, :, 1:3], turned)

    fit = fit_best(bare, states, measured + sag(states), None)
    assert "compliance" in {e.name for e in fit.combination.effects}
    plain = fit_best(NJ, states, measured, None)
    truth = sag(held)
    left = [f.combination.error(ArmStates(NJ, held), f.values) for f in (fit, plain)]
    gap = np.linalg.norm(left[0] - left[1] - truth, axis=1)
    assert gap.mean() < 0.05 * np.linalg.norm(truth, axis=1).mean()


def test_only_covariates_that_vary_are_candidates() -> None:
    rng = np.random.default_rng(0)
    bare = random_states(50, rng)
    assert not {"thermal", "payload", "lag"} & set(candidates(NJ, bare))
    assert {"thermal", "payload", "lag"} <= set(candidates(NJ, covariates(bare, rng)))
    timed = bare.with_(time=60.0 * np.arange(50.0))
    assert "thermal" in candidates(NJ, timed)  # a warm-up in time
    assert "thermal" not in candidates(NJ, bare.with_(time=0.2 * np.arange(50.0)))


def test_a_warm_up_in_time_is_told_with_the_state_that_predictions_are_for() -> None:
    rng = np.random.default_rng(8)
    arm, clock = random_arm(rng), 60.0 * np.arange(300.0)
    states = random_states(300, rng).with_(time=clock)
    measured, tcp = arm.measure(states, rng)
    cold = np.exp(-clock / (0.2 * np.ptp(clock)))
    measured = measured - 1.2e-4 * cold[:, None] * tcp
    effects = propose((*BASE_EFFECTS, "thermal"), NJ, states)
    (told,) = drifts(fit_effects(ArmStates(NJ, states), measured, effects))
    left, kept = (float(word) for word in told.split() if word.startswith("0."))
    assert kept > 1.5 * left
    assert "Predictions are for the warm arm: it may be tracker_drift" in told
    assert not drifts(fit_effects(ArmStates(NJ, states), measured, effects[:-1]))


@pytest.mark.slow
def test_waves_in_what_splines_follow_are_named_with_order_and_size() -> None:
    rng = np.random.default_rng(5)
    states = random_states(700, rng)
    measured, _ = random_arm(rng).measure(states, rng)
    J, q = ArmStates(NJ, states).jacobian, states.q
    for order, size in ((17.0, 3e-4), (31.0, 1.5e-4)):
        measured = measured + J[:, :, 1] * (size * np.sin(order * q[:, [1]] + 1.0))
    spot = np.exp(-0.5 * ((q[:, [2]] + 1.9) / 0.1) ** 2)
    fit = fit_best(NJ, states, measured + J[:, :, 2] * (2e-4 * spot), None)
    waves = {f.wave[0]: f for f in find(fit) if f.wave is not None}
    assert all(f.joint == 2 for f in waves.values())
    for order, mrad in ((17.0, 0.3), (31.0, 0.15)):
        found, size, error = min(
            (f.wave for f in waves.values() if f.wave is not None),
            key=lambda wave: abs(wave[0] - order),
        )
        assert abs(found - order) < 0.1
        assert abs(size - mrad) < 4 * error


@pytest.mark.slow
def test_waves_are_named_before_splines_are_fine_enough_to_take_them_up() -> None:
    rng = np.random.default_rng(9)
    states, held = (narrow(random_states(n, rng)) for n in (900, 300))
    measured, _ = random_arm(rng).measure(states, rng)
    low, high = states.q[:, 2].min(), states.q[:, 2].max()
    places, signs = rng.uniform(low, high, 15), rng.choice([-1.0, 1.0], (15, 1))

    def planted(at: States) -> Floats:  # a wave, and spots in places of their own
        q = at.q[:, [1]]
        turned = (
            3e-4 * np.sin(17.0 * q + 1.0),
            2e-4 * np.exp(-0.5 * ((at.q[:, [2]] - places) / 0.013) ** 2) @ signs,
        )
        J = ArmStates(NJ, at).jacobian
        moved: Floats = J[:, :, 1] * turned[0] + J[:, :, 2] * turned[1]
        return moved

    fit = fit_best(NJ, states, measured + planted(states), None)
    plain = fit_best(NJ, states, measured, None)
    effects = fit.combination.effects
    waves = [e.waves[0] for e in effects if isinstance(e, Transmission)]
    assert any(j == 2 and abs(order - 17.0) < 0.1 for j, order in waves)
    (spline,) = [e for e in effects if isinstance(e, JointSpline)]
    assert min(spline.lengths) < SHORTEST
    coarse = JointSpline.propose(NJ, states)
    others = tuple(coarse if e is spline else e for e in effects)
    before = fit_effects(fit.batch, measured + planted(states), others)
    at = ArmStates(NJ, held)
    truth = plain.combination.error(at, plain.values) + planted(held)
    fine, rough = (
        np.linalg.norm(f.combination.error(at, f.values) - truth, axis=1).mean()
        for f in (fit, before)
    )
    assert fine < 0.7 * rough


def narrow(states: States) -> States:
    """Move the joints by a third as far."""
    middle = states.q.mean(axis=0)
    return states.with_(q=middle + (states.q - middle) / 3.0)


def waved(seed: int, rows: int) -> tuple[States, Floats]:
    """Survey an arm whose joint 2 has a wave of order 17, 0.3 mrad."""
    rng = np.random.default_rng(seed)
    states = random_states(rows, rng)
    measured, _ = random_arm(rng).measure(states, rng)
    q = states.q[:, [1]]
    return states, measured + ArmStates(NJ, states).jacobian[:, :, 1] * (
        3e-4 * np.sin(17.0 * q + 1.0)
    )


@pytest.mark.slow
def test_a_wave_is_named_in_a_short_survey() -> None:
    states, measured = waved(9, 300)
    waves = [f.wave for f in find(fit_best(NJ, states, measured, None)) if f.wave]
    assert len(waves) == 1
    order, size, error = waves[0]
    assert abs(order - 17.0) < 0.2
    assert abs(size - 0.3) < 4 * error


def test_a_wave_of_few_rows_predicts_regions_that_it_was_not_found_in() -> None:
    states, measured = waved(10, 200)
    few = regions(states.q) == 0
    turned = 3e-4 * few[:, None] * np.cos(23.0 * states.q[:, [2]])
    measured = measured + ArmStates(NJ, states).jacobian[:, :, 2] * turned
    kept = propose(BASE_EFFECTS, NJ, states)
    true, local = Transmission(((2, 17.0),)), Transmission(((3, 23.0),))
    fitted = fit_effects(ArmStates(NJ, states), measured, (*kept, true, local))
    assert local in keep_needed(fitted, always=(), aside=kept)  # by evidence alone
    assert waves_needed(fitted, kept) == (*fitted.combination.effects[:-2], true)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["joint_product", "worn_spot"])
def test_free_forms_of_hardly_any_rows_must_carry_over(law: str) -> None:
    """A product of angles is none that they follow; a worn spot is one."""
    left = []
    for seed in range(4):
        arm = virtual_arm(seed, (*BASE, f"{law}=0.5"))
        old, fresh = survey(arm, seed, 80), survey(arm, seed + 500, 200)
        read = arm.measure(old, TRACKER, stream(seed, "m"))
        states, truth = states_of(fresh), arm.error(fresh)
        for fit in (
            fit_best(ARM, states_of(old), read, tuple(TRACKER)),
            fit_effects(
                ArmStates(ARM, states_of(old)), read,
                propose(BASE_EFFECTS, ARM, states_of(old)), tuple(TRACKER),
            ),
        ):  # fmt: skip
            off = truth - fit.combination.error(ArmStates(ARM, states), fit.values)
            left.append(np.linalg.norm(off, axis=1).mean())
    fitted, plain = np.mean(np.reshape(left, (-1, 2)), axis=0)
    assert fitted < (1.1 if law == "joint_product" else 0.6) * plain
