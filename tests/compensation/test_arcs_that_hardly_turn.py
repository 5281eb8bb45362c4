"""Arcs on which the tool turns by tenths of degrees, and it is not known how."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.compensation.compensate import compensate
from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.motion.spline_moves import turns_at_unknown_blends, turns_on_arcs
from postproc.motion.targets import Fly
from postproc.report.simulation import setup_of
from postproc.robot.arm import load_arm
from postproc.robot.trajectory import Motion
from postproc.simulation import land, virtual_arm
from tests.conftest import SEED
from tests.language.neutral_job import NeutralMove, drawn, rapid
from tests.made_targets import make_targets

ARM = load_arm("nj220-2.7")
STEPS = 200


def turned(pose, vector):
    """Turn a pose about its own place, by a rotation vector in the base [rad]."""
    out = np.array(pose)
    out[:3, :3] = Rotation.from_rotvec(vector).as_matrix() @ out[:3, :3]
    return out


def solved(poses, near):
    """Solve flange poses on the branch of joint angles, turns unwrapped."""
    found = ARM.inverse(np.array(poses)).q[:, int(ARM.branch(near[None])[0])]
    return near + np.angle(np.exp(1j * (found - near)))


def circle(start, radius, angles, rng):
    """Place a tool on a circle through a pose, without turning it, (k, 4, 4)."""
    normal, out = rng.normal(size=3), []
    normal /= np.linalg.norm(normal)
    arm = np.cross(normal, rng.normal(size=3))
    arm *= radius / np.linalg.norm(arm)
    for angle in angles:
        pose = np.array(start)
        pose[:3, 3] += Rotation.from_rotvec(angle * normal).apply(arm) - arm
        out.append(pose)
    return np.array(out)


def side_of(path):
    """Return on which side joints arrive that follow a path, (6,), by their play."""
    drive = path @ ARM.coupling.T
    low = high = drive[0]
    for q in drive:
        low = np.minimum(np.maximum(low, q - ARM.play), q)
        high = np.minimum(np.maximum(high, q - ARM.play), q)
    back = drive[-1] - 0.5 * (low + high)  # the link lags behind its drive
    return np.clip(2.0 * back / ARM.play - 1.0, -1.0, 1.0)


def test_sides_that_are_sure_are_so_however_the_tool_turns():
    """On its way the tool is off by up to twice what it turns by in all."""
    rng, sure, wrong = np.random.default_rng(5), 0, 0
    at = np.linspace(0.0, 1.0, STEPS)
    for _ in range(40):
        q = np.deg2rad([20, -25, -110, 30, 50, 20]) + np.deg2rad(rng.uniform(-9, 9, 6))
        start = ARM.flange(q[None])[0]
        turn = np.deg2rad(rng.uniform(0.02, 0.5))
        total = Rotation.random(random_state=rng).apply([turn, 0, 0])
        places = circle(start, rng.uniform(0.005, 0.2), 2.5 * at, rng)
        poses = [turned(p, s * total) for p, s in zip(places, at, strict=True)]
        planned = solved(poses, q)
        if np.isnan(planned).any():
            continue
        half = STEPS // 2
        targets = make_targets(
            np.zeros(3), np.array(poses)[[0, half, -1]], via=[False, True, False],
            move=[Motion.LINEAR, Motion.CIRCULAR, Motion.CIRCULAR],
            along=[False, True, True],
        )  # fmt: skip
        sides = np.stack([np.zeros(6), side_of(planned[:half]), side_of(planned)])
        known = ~turns_on_arcs(ARM, targets, planned[[0, half, -1]], sides)[2]
        sure += known.sum()
        for k in range(6):
            way = rng.normal(size=3)
            way *= 2.0 * turn / np.linalg.norm(way)
            wave = np.sin((k % 2 + 1) * np.pi * at)
            other = [turned(p, w * way) for p, w in zip(poses, wave, strict=True)]
            gone = side_of(solved(other, q))
            wrong += (known & (gone * sides[2] < 0.9 * np.abs(sides[2]))).sum()
    assert sure > 40 and wrong == 0


def test_arcs_that_begin_where_rounding_is_not_known():
    """A joint that begins an arc against its arrival is not sure."""
    rng, against = np.random.default_rng(7), 0
    at = np.linspace(0.0, 1.0, STEPS)
    for _ in range(40):
        q = np.deg2rad([20, -25, -110, 30, 50, 20]) + np.deg2rad(rng.uniform(-9, 9, 6))
        total = Rotation.random(random_state=rng).apply([0.05, 0, 0])
        places = circle(ARM.flange(q[None])[0], 0.1, rng.uniform(1, 4) * at, rng)
        poses = [turned(p, s * total) for p, s in zip(places, at, strict=True)]
        way = solved(poses, q)
        if np.isnan(way).any():
            continue
        half = int(rng.uniform(0.2, 0.8) * STEPS)
        targets = make_targets(
            np.zeros(3), np.array(poses)[[0, half, -1]], via=[False, True, False],
            move=[Motion.LINEAR, Motion.CIRCULAR, Motion.CIRCULAR],
            fly=[True, True, False], rounding=[Fly.UNKNOWN, Fly.EXACT, Fly.EXACT],
        )  # fmt: skip
        drive = way @ ARM.coupling.T
        first, chord = drive[2] - drive[0], drive[half] - drive[0]
        sides = np.stack([-np.sign(first), np.zeros(6), np.zeros(6)])
        unsure = turns_at_unknown_blends(ARM, targets, way[[0, half, -1]], sides)
        goes = np.abs(first) > ARM.play
        against += (goes & (chord * first < 0.0)).sum()
        assert unsure[0, goes].all()
        same = turns_at_unknown_blends(ARM, targets, way[[0, half, -1]], -sides)
        both = goes & (chord * first > 0.0) & (np.abs(chord) > ARM.play)
        assert not same[0, both].any()
    assert against > 5


def arcs(cell, seed):
    """Draw a job of arcs on which the tool turns by tenths of degrees."""
    rng, job, moves = np.random.default_rng(seed), drawn(cell, seed, 1), []
    for _ in range(8):
        q = np.deg2rad([20, -25, -110, 30, 50, 20]) + np.deg2rad(rng.uniform(-9, 9, 6))
        start = cell.arm.flange(q[None])[0] @ job.tool
        poses = circle(start, rng.uniform(0.03, 0.15), [0.0, 1.2, 2.4], rng)
        poses = [turned(p, np.deg2rad(rng.normal(0, 0.06, 3))) for p in poses]
        ways = solved([p @ np.linalg.inv(job.tool) for p in poses], q)
        moves.append(NeutralMove(Motion.LINEAR, ways[0]))
        moves.append(NeutralMove(Motion.CIRCULAR, ways[2], via=ways[1]))
    text = rapid(replace(job, moves=(job.moves[0], *moves)))
    return text.replace(b"    CirPathMode\\CirPointOri;\n", b"")


@pytest.mark.parametrize("seed", range(3))
def test_the_arm_lands_at_the_ends(bench_cell, bench_model, seed):
    source = arcs(bench_cell, seed)
    found = compensate(source, bench_cell, bench_model, name="job.mod")
    setup, d, v = setup_of(bench_cell), found.decisions, found.visits
    given, made = (
        read_program({"job.mod": text}, bench_cell).visits
        for text in (source, found.outputs["job.mod"])
    )
    landing = land(virtual_arm(SEED, tool=setup.tool), setup, given, made)
    rows = landing.visit
    ends = (
        (v.motion.kind == Motion.CIRCULAR)
        & ~v.motion.via
        & (d.status == Status.CORRECTED)
    )
    sure = ends & (d.direction != 0).all(axis=1)
    miss = 1e3 * np.linalg.norm(landing.error, axis=1)
    assert ends.sum() >= 6
    assert miss[sure[rows]].max(initial=0.0) <= 0.1
    before = np.linalg.norm(d.correction[ends], axis=1)
    assert miss[ends[rows]].mean() < 0.5 * 1e3 * before.mean()


def test_an_arc_on_which_the_tool_turns_farther_is_left(bench_cell, bench_model):
    source = rapid(drawn(bench_cell, 2)).replace(
        b"    CirPathMode\\CirPointOri;\n", b""
    )
    found = compensate(source, bench_cell, bench_model, name="job.mod")
    ends = found.visits.motion.kind == Motion.CIRCULAR
    assert ends.sum() > 3 and (found.decisions.status[ends] != Status.CORRECTED).all()
