"""Effects that weight drives, wherever it pulls and whichever joint it loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.model.effects import restore
from postproc.model.effects.base_tilt import BaseTilt
from postproc.model.effects.bending import BENDING, Bending
from postproc.model.effects.compliance import SCALE, YIELDING, Compliance
from postproc.model.effects.held_backlash import HeldBacklash
from postproc.model.effects.load_backlash import LoadBacklash
from postproc.model.kinematics import ArmStates
from tests.calibration.simulator import NJ, random_states

STATES = random_states(60, np.random.default_rng(2))
WALL = NJ.mount(np.array([1.0, 0.0, 0.0]))
BARE = replace(NJ, file=NJ.file.model_copy(update={"links": None}))


def test_the_joints_that_weight_loads_may_yield() -> None:
    floor, wall = (Compliance.on(ArmStates(arm, STATES)) for arm in (NJ, WALL))
    assert set(YIELDING) <= set(floor.joints) and 4 in floor.joints
    assert 1 not in floor.joints and 1 in wall.joints
    unknown = Compliance.on(ArmStates(BARE, STATES))
    assert {2, 3, 4, 5} <= set(unknown.joints) and 1 not in unknown.joints


def test_joints_that_carry_little_are_softer() -> None:
    effect = Compliance.on(ArmStates(NJ, STATES))
    soft = dict(zip(effect.joints, effect.softness, strict=True))
    assert soft[2] == pytest.approx(SCALE, rel=0.5) and soft[5] > 5 * soft[2]
    pieces = effect.pieces()
    assert [p.joints for p in pieces] == [(j,) for j in effect.joints]
    whole = [p for piece in pieces for p in piece.parameters()]
    assert tuple(whole) == effect.parameters()


def test_model_files_of_older_releases_are_read() -> None:
    old = {"joints": [2, 3], "moments": [[[2, 5.0]], []], "payload": False}
    effect = restore("compliance", old)
    assert effect.parameters()[0].scale == SCALE
    assert [p.parameters()[0].name for p in effect.pieces()] == ["k2", "k3"]
    assert restore("base_tilt", {"skew": True, "unsure": 3.0}) == BaseTilt(True, 3.0)


def test_bending_turns_the_tool_by_the_moment_across_the_joint() -> None:
    batch = ArmStates(WALL, STATES)
    effect = Bending((4,), ((),), False, (SCALE,))
    moment, frames = batch.loads.bending[:, 3], WALL.link_frames(STATES.q)
    turns = effect.rotation_columns(batch)
    for a in range(2):
        wanted = frames[:, 3, :3, a] * moment[:, a, None]
        np.testing.assert_allclose(turns[:, :, a], wanted, atol=1e-9)
    assert effect.only_joint() is None and Bending.on(batch).joints[0] == BENDING[0]


def test_bending_and_compliance_share_the_moments_of_the_links() -> None:
    batch = ArmStates(BARE, STATES)
    yields, bends = Compliance.on(batch), Bending.on(batch)
    own = dict(zip(yields.joints, yields.moments, strict=True))
    for joint, links in zip(bends.joints, bends.moments, strict=True):
        assert joint not in own or own[joint] == links
    assert all(p.scale > 0 for p in bends.parameters())


def test_a_base_on_a_wall_is_turned_about_all_axes() -> None:
    batch = ArmStates(WALL, STATES)
    (plain, _) = (c.effect for c in BaseTilt.candidates(batch))
    names = [p.name for p in plain.parameters()]
    assert {"kx", "ky", "kz"} <= set(names)
    turns = plain.rotation_columns(batch)
    for axis, name in enumerate(("kx", "ky", "kz")):
        wanted = batch.loads.tilting[:, axis]
        np.testing.assert_allclose(turns[:, axis, names.index(name)], wanted)
    assert not BaseTilt.propose(NJ, STATES).twist


def test_a_flank_that_weight_chooses_must_show_its_bend() -> None:
    batch = ArmStates(NJ, STATES)
    torque = batch.loads.total[:, 1]
    largest = float(np.abs(torque).max())
    flank = LoadBacklash((2,), "gravity_side", 0.3 * largest)
    assert flank.passes_bend(batch)
    straight = replace(flank, t0=2.0 * largest)  # there the law is compliance
    assert not straight.passes_bend(batch)
    one_way = batch[np.flatnonzero(torque > 0.6 * largest)]
    assert not replace(flank, t0=0.1 * largest).passes_bend(one_way)
    assert replace(straight, form="signed").passes_bend(one_way)
    assert straight not in flank.refine(np.linspace(-1, 2, 9), batch)
    assert all(law.passes_bend(batch) for law in flank.refine(np.arange(3.0), batch))


def test_a_gear_rests_where_weight_puts_it_if_friction_does_not_hold_it() -> None:
    batch = ArmStates(NJ, STATES)
    torque, side = batch.loads.total[:, 1], STATES.direction[:, 1]
    held = HeldBacklash((2,), float(np.median(np.abs(torque))))
    away = np.abs(np.abs(torque) / held.holds - 1.0)
    clear = away > 0.3
    beyond = np.abs(torque) > held.holds
    assert clear[beyond].any() and clear[~beyond].any() and held.shows(batch)
    b = -1e-4  # of `backlash`
    turned = b * side + held.angles(batch, np.array([b, b]))[:, 1]
    wanted = np.where(beyond, b * np.sign(torque), b * side)
    np.testing.assert_allclose(turned[clear], wanted[clear], atol=2e-2 * abs(b))
    assert not replace(held, holds=1e3 * held.holds).shows(batch)
    more = held.hold(1.2)
    assert more.holds == pytest.approx(1.2 * held.holds)
    assert LoadBacklash().hold(1.2) is None
