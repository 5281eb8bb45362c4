"""Arcs that end at an angle (KRL's CA) end where they should."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.compensation.outcome import Status
from postproc.compensation.solver.arc_angles import (
    ASTRAY,
    NO_END,
    NO_START,
    TILTED,
    points_to_write,
)
from postproc.compensation.solver.continuity import ANGLED
from tests.compensation.curved import (  # noqa: F401
    CENTRE,
    KR,
    curved_cell,
    curved_model,
    curved_truth,
    frame,
    job,
    plans,
    points,
    tool_pose,
)


def circle(a: np.ndarray, b: np.ndarray, c: np.ndarray, deg: float) -> np.ndarray:
    """Go from a by an angle along the circle through a, b and c."""
    u, v = b - a, c - a
    normal = np.cross(u, v)
    # The centre is as far from all three, in their plane.
    left = np.stack([u, v, normal])
    centre = a + np.linalg.solve(left, [u @ u / 2, v @ v / 2, 0.0])
    turn = Rotation.from_rotvec(np.deg2rad(deg) * normal / np.linalg.norm(normal))
    return centre + turn.apply(a - centre)


def drawn(rng: np.random.Generator, deg: float, past: float) -> list[str]:
    """Write a line to an arc, and the arc: its third point lies at another angle."""
    q = CENTRE + rng.uniform(-1, 1, 6) * np.deg2rad([30, 8, 8, 30, 15, 30])
    start = KR.flange(q[None])[0] @ tool_pose()
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    radius = np.cross(normal, rng.normal(size=3))
    radius *= rng.uniform(0.04, 0.12) / np.linalg.norm(radius)
    via, third = np.array(start), np.array(start)
    for pose, angle in ((via, 0.5 * deg), (third, past)):
        turn = Rotation.from_rotvec(np.deg2rad(angle) * normal)
        pose[:3, 3] += turn.apply(radius) - radius
    return [
        f"LIN {frame(start)}",
        f"CIRC {frame(via)},{frame(third)},CA {deg}",
    ]


def test_arcs_end_where_they_should(cell, truth, model):
    rng, lines, angles = np.random.default_rng(18), [], []
    for deg, past in ((180.0, 120.0), (90.0, 150.0), (270.0, 200.0), (290.0, 230.0)):
        lines += drawn(rng, deg, past)
        angles.append(deg)
    source = job(*lines)
    done, (wanted, made) = plans(source, cell, model)
    decided = done.decisions
    assert (decided.status[2:11] == Status.CORRECTED).all()
    assert decided.reasons[decided.why[12]] == ASTRAY  # so long an arc bends too much
    tool = np.tile(cell.tool.pose[:3, 3], (len(made.q), 1))
    really = truth.tcp(made.q, made.direction, tool)
    for k, deg in enumerate(angles[:3]):
        start, _, end = 2 + 3 * k + np.arange(3)
        old, new = (points(t)[3 * k :][:3] for t in (source, done.outputs["job.src"]))
        commanded = circle(*new, deg)
        assert np.allclose(made.tcp[end, :3, 3], commanded, atol=2e-6)
        asked = circle(*old, deg)
        assert np.allclose(wanted.tcp[end, :3, 3], asked, atol=2e-6)
        without = np.linalg.norm(
            truth.tcp(wanted.q, wanted.direction, tool)[end] - asked
        )
        assert without > 3e-4
        assert np.linalg.norm(really[end] - asked) < 2e-5
        assert np.linalg.norm(really[start] - old[0]) < 2e-5


def test_nothing_but_numbers_changes(cell, model):
    source = job(*drawn(np.random.default_rng(19), 200.0, 150.0))
    done, _ = plans(source, cell, model)
    text = done.outputs["job.src"]
    assert re.search(rb"CA 200\.0", text)
    blank = [re.sub(rb"-?\d+(\.\d+)?", b"0", t).split(b"\n") for t in (source, text)]
    assert blank[0] == [line for line in blank[1] if not line.startswith(b";")]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("CA 200.0", "CA 360"), NO_END),
        (("CA 200.0", "CA -200"), NO_END),
        (("CA 200.0", "CA 60"), NO_END),
        (("LIN {", "PTP {A1 1,A2 -80,A3 100,A4 1,A5 50,A6 1}\n;LIN {"), NO_START),
        (("CIRC {", "$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}\nCIRC {"), NO_START),
    ],
)
def test_what_is_not_sure_is_left(cell, model, change, why):
    lines = "\n".join(drawn(np.random.default_rng(19), 200.0, 150.0))
    assert change[0] in lines
    source = job(lines.replace(*change))
    done, _ = plans(source, cell, model)
    decided = done.decisions
    assert decided.reasons[decided.why[-1]] == why
    assert not (decided.status[-2:] == Status.CORRECTED).any()


def test_a_tool_that_turns_is_left(cell, model):
    lines = drawn(np.random.default_rng(19), 200.0, 150.0)
    first, last = lines[1].rsplit(",A ", 1)
    angle, rest = last.split(",", 1)
    source = job(lines[0], f"{first},A {float(angle) + 2.0:.4f},{rest}")
    decided = plans(source, cell, model)[0].decisions
    assert decided.reasons[decided.why[-1]] == TILTED


def test_the_start_stays_with_an_arc_that_is_left(cell, model):
    lines = drawn(np.random.default_rng(19), 200.0, 150.0)
    lines[1] += " ; TAUGHT"
    decided = plans(job(*lines), cell, model)[0].decisions
    assert not (decided.status[2:] == Status.CORRECTED).any()
    assert decided.reasons[decided.why[2]] == ANGLED


def test_a_similarity_keeps_the_angle():
    rng = np.random.default_rng(20)
    for _ in range(50):
        before = rng.normal(size=(3, 1, 3))
        after = before + 1e-3 * rng.normal(size=(3, 1, 3))
        u, v = before[1, 0] - before[0, 0], before[2, 0] - before[0, 0]
        normal = np.cross(u, v)
        left = np.stack([u, v, normal])
        centre = before[0, 0] + np.linalg.solve(left, [u @ u / 2, v @ v / 2, 0.0])
        normal /= np.linalg.norm(normal)
        a, b = before[0, 0] - centre, before[2, 0] - centre
        angle = np.arctan2(np.cross(a, b) @ normal, a @ b) % (2 * np.pi)
        b = before[1, 0] - centre  # the third point lies behind the one on the way
        to_via = np.rad2deg(np.arctan2(np.cross(a, b) @ normal, a @ b)) % 360.0
        third = circle(*before[:, 0], (to_via + 360.0) / 2)[None]
        via, end = points_to_write(before, after, third)
        found = circle(after[0, 0], via[0], end[0], np.rad2deg(angle))
        assert np.allclose(found, after[2, 0], atol=1e-9)
        assert np.linalg.norm(via[0] - after[1, 0]) < 0.05


def followed(old: np.ndarray, deg: float, q: np.ndarray, turn: np.ndarray):
    """Follow an arc in small steps from joint angles, (k, 6) [rad]."""
    poses = np.tile(np.eye(4), (int(2 * deg), 1, 1))
    poses[:, :3, :3] = turn
    poses[:, :3, 3] = [circle(*old, a) for a in np.linspace(0.0, deg, len(poses))]
    found = KR.inverse(poses @ np.linalg.inv(tool_pose())).q
    found = found[:, int(KR.branch(q[None])[0])]
    return np.unwrap(np.vstack([q, found]), axis=0)[1:]


@pytest.mark.parametrize(("deg", "past"), [(330, 250), (365, 250), (420, 300)])
def test_what_comes_behind_a_whole_circle_begins_at_its_end(
    cell, truth, model, deg, past
):
    sure = 0
    for seed in range(8):
        lines = drawn(np.random.default_rng(seed), float(deg), float(past))
        start = lines[0].removeprefix("LIN ")
        place = [float(x) for x in re.findall(r"[XYZ] ([-.\d]+)", start)]
        there = start.replace(f"Z {place[2]:.4f}", f"Z {place[2] + 60.0:.4f}")
        source = job(*lines, f"LIN {there}")
        done, (wanted, made) = plans(source, cell, model)
        decided = done.decisions
        assert not (decided.status[2:5] == Status.CORRECTED).any()
        assert decided.status[5] == Status.CORRECTED, decided.reasons[decided.why[5]]
        way = followed(points(source)[:3], deg, wanted.q[2], wanted.tcp[2, :3, :3])
        assert np.allclose(wanted.q[4], way[-1], atol=1e-4)
        last = way[-1] - way[-1 - int(deg) // 15]
        clear = np.abs(last) > 3.0 * KR.play.max()
        assert (decided.direction[4] * np.sign(last) >= 0)[clear].all()
        sure += int((clear & (decided.direction[4] != 0)).sum())
        side = decided.side[5][None]
        landing = truth.tcp(made.q[5][None], side, tool_pose()[None, :3, 3])[0]
        if (np.abs(side) > 0.999).all():
            assert np.linalg.norm(landing - wanted.tcp[5, :3, 3]) < 2e-5
    assert sure > 10


def test_a_circle_that_ends_where_it_begins_leads_nowhere_known(cell, model):
    lines = drawn(np.random.default_rng(1), 360.0, 250.0)
    decided = plans(job(*lines, lines[0]), cell, model)[0].decisions
    assert not (decided.status[2:] == Status.CORRECTED).any()
