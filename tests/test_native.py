"""The native core does what `tests/reference` defines, on hostile arrays too."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from postproc import _native
from postproc.arrays import few_rows, floats
from postproc.compensation.compensate import compensate
from postproc.language.text.source import NumberSpans
from postproc.model.effects.backlash_profile import BacklashProfile
from postproc.model.kinematics import ArmStates
from postproc.motion import blending
from postproc.motion import path as cartesian
from postproc.motion.branches import OTHER_TURN, on_other_turns, on_written_turns
from postproc.motion.path import ROUNDS, BlendCoupling
from postproc.robot import backlash_operator, direction, pose
from postproc.robot.arm import DH
from postproc.robot.backlash_operator import (
    NOTHING,
    Edges,
    LastReversal,
    PlayOperator,
    chains_of,
)
from postproc.robot.inverse import ClosedForm
from postproc.robot.pose import rotation_from_vector
from postproc.robot.state import make_states
from tests.bench import made
from tests.reference import kinematics, paths, statements
from tests.reference import play as plain

ROOT = Path(__file__).parent.parent
PROGRAMS = ROOT / "programs"
CLOSE = {"rtol": 0, "atol": 1e-12, "equal_nan": True}
LAYOUTS = {
    "rows": np.ascontiguousarray,
    "columns": np.asfortranarray,
    "every other": lambda rows: np.repeat(rows, 2, axis=0)[::2],
    "none": lambda rows: rows[:0],
    "one": lambda rows: rows[:1],
}


@pytest.fixture
def random():
    return np.random.default_rng(20)


@pytest.fixture(params=LAYOUTS)
def laid_out(request):
    """Lay the rows of an array out in some way."""
    return LAYOUTS[request.param]


@pytest.fixture
def chain(random):
    a, d, alpha, offset = random.normal(size=(4, 6))
    mix = np.eye(6) + 0.1 * random.normal(size=(6, 6))
    return DH(a, d, alpha, offset, np.array([1.0, -1, 1, 1, -1, 1]), mix)


def hash_of_sources() -> str:
    """As native/build.rs does it."""
    found = 0xCBF29CE484222325
    for path in sorted((ROOT / "native" / "src").iterdir()):
        for byte in path.read_bytes():
            found = (found ^ byte) * 0x100000001B3 % 2**64
    return f"{found:016x}"


def test_the_core_is_that_of_these_sources():
    assert _native.SOURCES == hash_of_sources(), "build it again: pip install -e ."


def test_the_chain(chain, random, laid_out):
    q, points = random.uniform(-7, 7, (60, 6)), random.normal(size=(60, 3))
    beta = np.array([0, 0.1, 0, 0, -0.2, 0])
    q[7, 2] = np.nan
    q, points = laid_out(q), laid_out(points)
    for given in ((q, points), (q, np.ones(3)), (q, points, beta)):
        assert np.allclose(chain.place(*given), kinematics.placed(chain, *given),
                           **CLOSE)  # fmt: skip
    # A pose with an angle that is no number is none at all there, in part here.
    found, meant = chain.flange(q), kinematics.flange(chain, q)
    known = ~np.isnan(q).any(axis=1)
    assert np.allclose(found[known], meant[known], **CLOSE)
    assert np.isnan(found[~known, :3, 3]).any(axis=1).all()


def test_what_is_seen_along_the_chain(chain, random, laid_out):
    q, points = random.uniform(-7, 7, (60, 6)), random.normal(size=(60, 3))
    packed, q, points = chain.pack(), laid_out(q), laid_out(points)
    frames, given = kinematics.frames(chain, q), (floats(q), floats(points))
    found = _native.frames(packed, given[0]).reshape(-1, 7, 4, 4)
    assert np.allclose(found, frames, **CLOSE)
    seen = _native.landmarks(packed, *given)
    tcp = kinematics.placed(chain, q, points)
    meant = np.stack([frames[:, 2, :3, 3], frames[:, 4, :3, 3], tcp], axis=1)
    assert np.allclose(seen, meant, **CLOSE)
    columns = np.swapaxes(_native.jacobian(packed, *given), 1, 2)
    assert np.allclose(columns, kinematics.jacobian(chain, q, points), **CLOSE)
    links, load = random.uniform(0, 300, (6, 4)), random.uniform(-1, 90, (len(q), 4))
    torque = _native.torque(packed, given[0], links, load)
    for found, masses in zip(
        torque, ((links, 0 * load), (0 * links, load)), strict=True
    ):
        meant = kinematics.torque(chain, q, *masses)
        assert np.allclose(found, meant, rtol=1e-12, atol=1e-6)
    unloaded = _native.torque(packed, given[0], links, np.array([[0.0, np.nan, 0, 0]]))
    assert np.array_equal(unloaded[0], torque[0]) and not unloaded[1].any()
    one = _native.torque(packed, given[0][:1], links, load[:1])
    assert np.array_equal(one, [found[:1] for found in torque])
    for wrong in (np.ones((2, 3)), np.ones((7, 3))):
        with pytest.raises(ValueError, match="columns of"):
            _native.landmarks(packed, given[0], wrong)
        with pytest.raises(ValueError, match="columns of"):
            _native.jacobian(packed, given[0], wrong)
    with pytest.raises(ValueError, match="columns of"):
        _native.torque(packed, given[0], links, np.ones((7, 4)))


def test_how_far_joint_angles_lead_from_others(chain, random, laid_out):
    """10,000 rows are dealt to threads; unknown angles and points stay unknown."""
    old = random.uniform(-3, 3, (10_000, 6))
    new, points = (
        old + random.normal(0, 1e-3, old.shape),
        random.normal(size=(10_000, 3)),
    )
    old[3, 2], new[5, 0], points[9, 1] = np.nan, np.nan, np.nan
    offset = np.array([1e-3, -1e-3, 0, 5e-4, 0, -2e-3])
    old, new, points = laid_out(old), laid_out(new), laid_out(points)
    given = (floats(old), floats(new)), floats(points), offset
    arm = chain.pack(), _native.Solver.of_chain(chain.pack())
    *found, branch = _native.departure(*arm, *given)
    slots = np.array([arm[1].slots(floats(q)) for q in (old, new)])
    known = ~np.isnan(old + new).any(axis=1)
    assert np.array_equal(branch, _differ(slots, old, new) & known)
    assert branch.any() or len(branch) < 100
    few = np.r_[:20, max(len(old) - 20, 0) : len(old)] if len(old) > 40 else slice(None)
    plain = kinematics.departure(chain, old[few], new[few], points[few], offset)
    for seen, meant in zip(found, plain, strict=True):
        assert np.allclose(seen[few], meant, **CLOSE)
    with pytest.raises(ValueError, match="columns of"):
        _native.departure(*arm, given[0], np.ones((2, 3)), offset)


def _differ(slots, old, new):
    """Tell which branches differ; a wrist that is straight within 1 mrad is on both."""
    both = np.abs(np.minimum(old[:, 4] * new[:, 4], 0.0)) < 1e-6
    return (np.bitwise_xor(*slots) & ~np.where(both, 4, 0)) != 0


def test_how_far_ways_lead_from_others(chain, random):
    """The largest at places inside, by interpolation between samples."""
    first = np.array([0, 0, 1, 2, 4, 5])  # one visit from two others
    source = np.array([0, 1, 1, 2, 3])
    count = np.array([3, 1, 4, 2, 6])
    parts = np.array([3, 4, 4, 2, 6])
    start = np.append(0, np.cumsum(count))
    q = random.uniform(-1, 1, (5, 6)) + np.array([0, 0, 0, 0, 1.5, 0])
    path = random.uniform(-1, 1, (start[-1], 6)) + np.array([0, 0, 0, 0, 1.5, 0])
    moved = random.normal(0, 0.3, path.shape)
    old = Edges(first, source, path, start)
    new = Edges(first, np.array([0, 1, 1, -1, 3]), path + moved, start)
    tool, offset = random.normal(size=(5, 3)), random.normal(0, 1e-3, 6)
    arm = chain.pack(), _native.Solver.of_chain(chain.pack())
    branched = np.array([True, True, False, True, True])
    found = _native.departure_along(
        *arm, ((old, q), (new, q + 0.01)), first, parts, branched, tool, offset
    )
    for visit in range(5):
        places = []
        for edge in range(first[visit], first[visit + 1]):
            if new.source[edge] != source[edge]:
                continue
            for share in np.arange(1, parts[edge]) / parts[edge]:
                both = [
                    _along(e, at, edge, share) for e, at in ((old, q), (new, q + 0.01))
                ]
                places.append(both)
        if not places:
            assert np.isnan(found[0][visit]).all() and not found[2][visit]
            continue
        a, b = np.array(places).swapaxes(0, 1)
        point = np.tile(tool[visit], (len(a), 1))
        joints, sizes = kinematics.departure(chain, a, b, point, offset)
        assert np.allclose(found[0][visit], joints.max(axis=0), **CLOSE)
        assert np.allclose(found[1][visit], sizes.max(axis=0), **CLOSE)
        slots = np.array([arm[1].slots(floats(x)) for x in (a, b)])
        meant = _differ(slots, a, b).any() and branched[visit]
        assert found[2][visit] == meant
    with pytest.raises(IndexError, match="edges that are not there"):
        _native.departure_along(
            *arm, ((old, q), (new, q)), first + 1, parts, branched, tool, offset
        )


def _along(edges, q, edge, share):
    """Interpolate between the samples of an edge."""
    samples = edges.path[edges.start[edge] : edges.start[edge + 1]]
    all_of_it = np.vstack([q[edges.source[edge]], samples])
    at = np.linspace(0, 1, len(all_of_it))
    return [np.interp(share, at, column) for column in all_of_it.T]


def test_what_a_share_of_ways_stays_within(random):
    """Ways of one sample, ways of no length, and equal values."""
    first = np.append(0, np.cumsum(random.integers(1, 40, 300)))
    values = random.uniform(0, 1, first[-1]).round(2)
    weight = random.uniform(0, 1, first[-1]) * (random.uniform(size=first[-1]) > 0.2)
    weight[first[3] : first[4]] = 0.0
    ways = random.permutation(300)[:200]
    for share in (0.5, 0.95, 1.0):
        given = share, values, weight, first, ways
        assert np.array_equal(_native.stays_within(*given), paths.stays_within(*given))
    for wrong in ([-1], [300]):
        with pytest.raises(IndexError, match="no such way"):
            _native.stays_within(0.5, values, weight, first, np.array(wrong))
    with pytest.raises(ValueError, match="columns of"):
        _native.stays_within(0.5, values, weight[1:], first, ways)


def test_whole_turns(random, laid_out):
    q, turns = random.uniform(-20, 20, (90, 6)), random.integers(-2, 3, (90, 3)) / 2.0
    q[:4] = [[0.0], [-0.0], [np.pi], [-np.pi]]
    q[5:8], turns[::5], q[11, 3], turns[::3, 2] = 2 * np.pi, np.nan, np.nan, np.nan
    q, turns = laid_out(q), laid_out(turns)
    meant = kinematics.on_turns(q, turns)
    assert np.array_equal(on_written_turns(q, turns), meant, equal_nan=True)
    others = (np.abs(meant - q) > OTHER_TURN).any(axis=1)
    assert np.array_equal(on_other_turns(q, turns), others)
    lower, upper = random.uniform(-7, 0, 6), random.uniform(0, 7, 6)
    found = _native.into_range(floats(q), lower, upper)
    meant = [list(map(kinematics.into_range, row, lower, upper)) for row in q]
    assert np.array_equal(found, np.reshape(meant, (-1, 6)), equal_nan=True)


def test_one_branch(bench_cell, random, laid_out):
    opw = bench_cell.arm.file.opw
    closed = ClosedForm(opw)
    reached = bench_cell.arm.flange(random.uniform(-3, 3, (80, 6)))
    reached[::7, :3, 3] *= 3.0  # out of reach
    slot = np.resize(np.arange(8), 80)
    reached, slot = laid_out(reached), laid_out(slot)
    all_of_them, one = closed.branches(reached), closed.branch(reached, slot)
    assert all_of_them.shape == (len(reached), 8, 6)
    assert np.array_equal(all_of_them[np.arange(len(slot)), slot], one, equal_nan=True)
    meant = [kinematics.branch(opw, *two) for two in zip(reached, slot, strict=True)]
    meant = np.reshape(meant, (-1, 6))
    off = np.angle(np.exp(1j * (one - meant)))
    assert np.isnan(one).tolist() == np.isnan(meant).tolist()
    assert len(reached) < 80 or np.isnan(one).any(axis=1).sum() > 5
    assert np.allclose(np.nan_to_num(off), 0.0, atol=1e-7)


def test_reversals(random, laid_out):
    q = laid_out(np.cumsum(random.normal(size=(500, 6)), axis=0))
    q[400:401] = np.nan
    before = LastReversal(np.sign(random.normal(size=6)), *random.normal(size=(2, 6)))
    play, at = random.uniform(0.1, 2.0, 6), np.flatnonzero(random.random(len(q)) < 0.4)
    found = backlash_operator.along(q, before, play, at)
    meant = plain.reversals(q, before, play)[:, at]
    for one, other in zip((found.side, found.angle, found.z), meant, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    for wrong in ([3, 2], [500]):
        with pytest.raises(IndexError, match="not there"):
            backlash_operator.along(q, before, play, np.array(wrong))


def test_walks_with_turning_values(random):
    count = random.integers(0, 7, 60)
    source = np.where(random.random(60) < 0.2, -1, random.integers(0, 20, 60))
    count[source >= 0] += 1  # none is empty but from an unknown place
    start = np.append(0, np.cumsum(count))
    values = np.cumsum(random.normal(size=(start[-1], 6)), axis=0)
    uneven = np.flatnonzero(random.random(len(values)) < 0.1)
    edges = Edges(np.empty(0), source, values, start, uneven)
    angles = random.normal(size=(20, 6))
    found = backlash_operator._insert_turning_values(angles, source, values, edges)
    meant = plain.refined(angles, source, values, start, uneven)
    assert np.array_equal(found.start, meant[1])
    assert len(found.values) > len(values)  # some joint did turn
    assert np.allclose(found.values, meant[0], **CLOSE)
    half = random.uniform(0.1, 1.0, 6)
    passed, wanted = found.clamps(half), plain.clamps(found.values, found.start, half)
    assert np.array_equal(passed.lo, wanted.lo) and np.array_equal(passed.hi, wanted.hi)


@pytest.mark.parametrize(
    "given", [NOTHING.play, plain.passing(np.zeros((1, 6)), np.ones(6))]
)
def test_states_in_a_graph(given, random):
    # Loops, jumps, unknown places and visits with several ways to them.
    n = 200
    count = np.where(random.random(n) < 0.2, random.integers(0, 4, n), 1)
    first = np.append(0, np.cumsum(count))
    source = np.repeat(np.arange(n), count) - 1
    odd = random.random(len(source)) < 0.15
    source[odd] = random.integers(-1, n, odd.sum())
    q = np.cumsum(random.normal(size=(n, 6)), axis=0)
    q[random.random(n) < 0.03] = np.nan
    chains, half = chains_of(q, np.eye(6), first, source), np.full(6, 0.8)
    steps = plain.passing(chains.angles[np.repeat(np.arange(n), count)], half)
    asked = chains, steps, half, given
    found, meant = direction._states(*asked), plain.states(*asked)
    assert np.array_equal(found.lo, meant.lo, equal_nan=True)
    assert np.array_equal(found.hi, meant.hi, equal_nan=True)
    sides = chains.angles, found, half
    placed = direction._side(*sides)
    assert np.array_equal(placed, plain.side(*sides))
    assert {-1.0, 0.0, 1.0} < set(placed.flat)


def test_states_that_are_no_numbers_end():
    # Two visits that lead to each other, one of them from an unknown place.
    first, source = np.array([0, 1, 3]), np.array([1, 0, -1])
    chains = chains_of(np.zeros((2, 6)), np.eye(6), first, source)
    steps = PlayOperator(np.full((3, 6), np.nan), np.full((3, 6), np.nan))
    found = direction._states(chains, steps, np.ones(6), NOTHING.play)
    assert len(found.lo) == 2


def test_straight_ways(bench_cell, random):
    flange = bench_cell.arm.flange(random.uniform(-3, 3, (300, 6)))
    flange[100:200, :3, :3] = flange[99, :3, :3]  # no turn at all
    flange[200:, :3, :3] = flange[200, :3, :3] @ rotation_from_vector(
        random.normal(size=(100, 3)) * np.logspace(-9, 0, 100)[:, None]
    )
    tool = np.repeat(bench_cell.arm.flange(np.ones((1, 6))), 300, axis=0)
    targets = SimpleNamespace(tool=tool)
    ends = np.arange(299), np.arange(1, 300)
    found = cartesian._lines(targets, flange, *ends)
    rotation, turn, begin, chord = paths.lines(tool, flange, *ends)
    assert np.allclose(found.rotation, rotation, **CLOSE)
    assert np.allclose(found.turn, turn, rtol=0, atol=1e-7)
    assert np.allclose(found.centre, begin, **CLOSE)
    assert np.allclose(found.chord, chord, **CLOSE)
    with pytest.raises(IndexError, match="not there"):
        _native.lines(flange, few_rows(tool), np.array([-1]), np.array([0]))


def test_poses(random, laid_out):
    record = random.uniform(-400, 400, (50, 6))
    record[3], record[4, 4:] = np.nan, 0.0
    record = laid_out(record)
    poses = pose.pose_from_record(record)
    meant = np.reshape([*map(kinematics.pose_from_record, record)], (-1, 4, 4))
    known = ~np.isnan(record).any(axis=1)
    assert np.allclose(poses[known], meant[known], **CLOSE)
    assert np.isnan(poses[~known, :3]).all()
    inverted = pose.inverse(poses)
    one_more = poses.reshape(1, *poses.shape)
    assert np.array_equal(pose.inverse(one_more)[0], inverted, equal_nan=True)
    assert np.allclose((inverted @ poses)[known], np.eye(4), **CLOSE)
    both = poses, poses[::-1]
    assert np.allclose(pose.times(*both), poses @ poses[::-1], **CLOSE)


def test_poses_of_other_numbers_are_refused():
    poses = np.repeat(np.eye(4)[None], 5, axis=0)
    with pytest.raises(ValueError, match="columns"):
        pose.times(poses, poses[:3])
    with pytest.raises(ValueError, match="behind the other"):
        _native.inverse(np.asfortranarray(poses))
    with pytest.raises(ValueError, match="rows of 5, not of 6"):
        _native.pose_from_record(np.zeros((2, 5)))
    with pytest.raises(TypeError):
        _native.inverse(poses.astype(np.float32))


def test_rotation_vectors(random):
    vectors = random.normal(size=(300, 3))
    vectors *= np.pi / np.linalg.norm(vectors, axis=1)[:, None]
    vectors[::3] *= random.uniform(0, 1, (100, 1))
    vectors[1::3] *= 1e-5
    turned = rotation_from_vector(vectors)
    turned[7], turned[8] = np.nan, np.eye(3)
    found = pose.rotation_vector(turned)
    assert np.isnan(found[7]).all() and not found[8].any()
    rest = np.delete(np.arange(300), [7, 8])
    meant = np.array([kinematics.rotation_vector(R) for R in turned[rest]])
    half_turn = np.linalg.norm(meant, axis=1) > np.pi - 1e-6  # both axes will do
    off = np.linalg.norm(found[rest] - meant, axis=1)
    other = np.linalg.norm(found[rest] + meant, axis=1)
    assert np.where(half_turn, np.minimum(off, other), off).max() < 1e-7
    assert len(pose.rotation_vector(turned[:0])) == 0


def test_corners_that_pull(random):
    visit = np.setdiff1d(np.arange(1, 299), random.integers(0, 299, 60))
    shares = random.uniform(0, 0.125, (2, len(visit)))
    along = random.normal(size=(len(visit), 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    pull = BlendCoupling(visit, visit - 1, visit + 1, *shares, along)
    wanted = random.normal(size=(300, 3))
    found = pull.to_move(wanted)
    assert np.allclose(found, paths.to_move(pull, wanted, ROUNDS), **CLOSE)
    assert np.array_equal(BlendCoupling().to_move(wanted), wanted)
    with pytest.raises(ValueError, match="none"):
        pull.to_move(wanted[:250])


@pytest.mark.parametrize(
    "effect",
    [
        BacklashProfile(lower=(-0.5,) * 6, upper=(0.6, 4, 0.6, 0.6, 0.6, 9)),
        BacklashProfile((2, 5), (4, 1), True, (-1.0,) * 6, (1.0,) * 6),
        BacklashProfile(joints=()),
    ],
)
def test_backlash_along_the_gear(effect, bench_cell, random):
    q, sizes = random.uniform(-7, 7, (300, 6)), random.normal(size=36)
    q[5, 1], q[::2] = np.nan, q[::2] / 10.0
    batch = ArmStates(bench_cell.arm, make_states(q, random.uniform(-1, 1, (300, 6))))
    p = sizes[: len(effect.parameters())]
    meant = np.zeros((300, 6))
    joints = np.asarray(effect.acts_on(), dtype=int)
    np.add.at(meant, (slice(None), joints), effect.basis(batch) * p)
    found = effect.angles(batch, p)
    assert np.allclose(found[:, joints], meant[:, joints], **CLOSE)
    assert not np.delete(found, joints, axis=1).any()


def test_corners_of_a_program(bench_cell, bench_model, monkeypatch):
    seen = []

    def compared(name, check):
        function = getattr(blending, name)

        def both(*args):
            found = function(*args)
            seen.append(name)
            check(found, *args)
            return found

        monkeypatch.setattr(blending, name, both)

    def corners(found, arm, targets, traced, zones):
        tool = targets.tool[zones.visit, :3, 3]
        point = traced.flange[zones.visit, :3, :3] @ tool[:, :, None]
        point = point[:, :, 0] + traced.flange[zones.visit, :3, 3]
        for c in range(0, len(zones.visit), 7):
            edge = zones.into[c], zones.out[c]
            size = found.zones.before[c], found.zones.behind[c]
            ends = [paths.along(traced, edge[0], 1 - size[0]),
                    paths.along(traced, edge[1], size[1])]  # fmt: skip
            bend = ends[0] + ends[1] - 2 * traced.q[zones.visit[c]]
            assert np.allclose(found.bend[c], bend, **CLOSE)
            q = paths.on_corner(traced, found.zones, c, found.nearest[c])
            assert np.allclose(found.q[c], q, **CLOSE)
            aside = arm.tcp(q[None], tool[c][None])[0] - point[c]
            assert np.allclose(found.aside[c], aside, **CLOSE)
            if (np.abs(bend) < paths.FLAT).all():
                off = [arm.tcp(e[None], tool[c][None])[0] - point[c] for e in ends]
                s = paths.nearest_on_parabola(*off)
                assert abs(s - found.nearest[c]) < 1e-4

    def zones(found, *given):
        columns = paths.zones(*given)
        own = found.visit, found.into, found.out, found.before, found.behind
        for column, meant in zip(own, columns, strict=True):
            assert np.allclose(column, meant, **CLOSE)

    def samples(found, *given):
        path, share, start, uneven = paths.samples(*given)
        assert np.allclose(found[0].path, path, **CLOSE)
        assert np.allclose(found[1], share, **CLOSE)
        assert np.array_equal(found[0].start, start)
        assert np.array_equal(found[0].uneven, uneven)

    compared("_pass_corners", corners)
    compared("_resample", samples)
    compared("zones", zones)
    compensate(made.milling(600).source, bench_cell, bench_model)
    jumps = b"  $FLY_TYPE := FLY_NORM\n" + b"".join(
        b"  MOVEFLY TO {%d, 15, -130, -149, -74, -92} ADVANCE\n" % q for q in (9, 12, 5)
    )
    milled = made.milling(40).source.replace(b"  SpindleOn(18000)\n", jumps)
    compensate(milled, bench_cell, bench_model)
    assert {"_pass_corners", "_resample", "zones"} <= set(seen)


# Long work lets other threads run, and ends when it is asked to.

LONG = """
import signal, sys, time
import numpy as np
from postproc import _native
signal.signal(signal.SIGINT, signal.default_int_handler)
rows = np.zeros((6_000_000, 6))
print("ready", flush=True)
try:
    while True:
        _native.pose_from_record(rows)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_an_interruption_is_heard_in_half_a_second():
    child = subprocess.Popen(
        [sys.executable, "-P", "-c", LONG], stdout=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    with child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.3)
        began = time.monotonic()
        child.send_signal(signal.SIGINT)
        assert child.stdout.readline() == "interrupted\n"
        assert time.monotonic() - began < 0.5


def test_other_threads_run_meanwhile():
    rows, ticks, done = np.zeros((3_000_000, 6)), [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    began = time.monotonic()
    _native.pose_from_record(rows)
    ended = time.monotonic()
    done.set()
    thread.join()
    assert sum(began < at < ended for at in ticks) > 3


def test_lines_that_begin_with_a_word(random):
    words = (b"import", b"call")
    pieces = [b"IMPORT", b"call", b"Cal", b" ", b"\t", b"\n", b"\r\n", b"x", b"\0", b""]
    for n in (0, 1, 3, 400):
        text = b"".join(pieces[k] for k in random.integers(0, len(pieces), n))
        lines = [line + b"\n" for line in text.split(b"\n")]
        lines[-1] = lines[-1][:-1]
        meant = [
            (number, line)
            for number, line in enumerate(lines, 1)
            if line.lstrip(b" \t").lower().startswith(words)
        ]
        assert _native.lines_beginning(text, words) == meant


def test_words_are_found_in_letters_of_any_size():
    text = b"MOVE TO p -- meaSUre\n\xffTAUGHT\nmeas"
    for word in (
        b"measure",
        b"taught",
        b"move",
        b"meas",
        b"\xff",
        b"absent",
        b"x" * 99,
    ):
        assert _native.holds(text, word) == (word.upper() in text.upper())
    for place in range(150):  # they are looked for in many places at once
        assert _native.holds(b"-" * place + b"TaughT" + b"-" * 140, b"taught")
        assert not _native.holds(b"-" * place + b"TaugXT" + b"-" * 140, b"taught")
    assert not _native.holds(b"", b"measure")
    with pytest.raises(ValueError, match="empty"):
        _native.holds(text, b"")


def test_lines_of_two_texts():
    texts = [
        (b"a := 1", b"a := 2"), (b"p(1.0)", b"p(1.00)"), (b"x", b"x"),
        (b"{1, 2}", b"{1, 3}"), (b"{0, 2}", b"{9, 3}"), (b"q 'o", b"q 'p"),
        (b"b 1 -- 2", b"b 3 -- 4"), (b"a := 7", b"b := 7"), (b"a := 5", b"a := 6"),
    ]  # fmt: skip
    pairs = [b"\n".join(text) for text in zip(*texts, strict=True)]
    first = [np.append(0, np.cumsum([len(t) + 1 for t in text])).astype(np.int32)
             for text in zip(*texts, strict=True)]  # fmt: skip
    rows, numbers = _native.compare_lines(pairs[0], first[0], pairs[1], first[1])
    row, begins, place, alike, braced = map(np.ndarray.tolist, rows)
    assert row == [0, 1, 3, 4, 5, 6, 7, 8]
    assert begins == [0, 1, 1, 3, 5, 5, 5, 5, 6]
    assert place == [5, -1, 1, 1, -1, -1, -1, 5]
    assert alike == [k in (3, 5, 6) for k in range(8)]
    assert braced == [k in (2, 3) for k in range(8)]
    old, new = map(np.ndarray.tolist, numbers)
    assert old == [1, 1, 2, 0, 2, 5] and new == [2, 1, 3, 9, 3, 6]


def _starts(*first):
    return np.array(first, dtype=np.int32)


def test_lines_that_are_not_there():
    for first in ([0, 9], [2, 1], [-1, 2], [0, 0]):
        with pytest.raises(IndexError, match="lines that are not there"):
            _native.compare_lines(b"abc", _starts(*first), b"abc", _starts(0, 4))
    with pytest.raises(ValueError, match="columns of"):
        _native.compare_lines(b"abc", _starts(0, 4), b"abc", _starts(0))
    none = _starts(3)
    assert len(_native.compare_lines(b"abc", none, b"", _starts(0))[0][0]) == 0


def test_statements_of_rapid(random):
    """What they are, `tests/language/rapid` holds; here: many, and views of bytes."""
    pieces = [
        b"MoveL ",
        b"p1",
        b"[1,-2]",
        b";",
        b"\n",
        b"! c",
        b"IF ",
        b"THEN",
        b'"a;"',
    ]
    for n in (0, 1, 20_000):
        text = b"".join(pieces[k] for k in random.integers(0, len(pieces), n))
        forms, by_statement, numbers, names, _ = _native.scan_statements(text)
        meant = statements.statements(text.decode("latin-1"))
        form, begin, end, first, _ = by_statement
        assert [forms[k].decode("latin-1") for k in form] == [s.form for s in meant]
        assert begin.tolist() == [s.begin for s in meant]
        assert end.tolist() == [s.end for s in meant]
        assert np.diff(first).tolist() == [len(s.numbers) for s in meant]
        assert len(names[1]) == sum(len(s.names) for s in meant)
        places = [place for s in meant for place in s.numbers]
        where = NumberSpans(*numbers[0])
        assert list(zip(where.start, where.end, strict=True)) == places
