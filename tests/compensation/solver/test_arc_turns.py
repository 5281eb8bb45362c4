"""Arcs of KRL on which the tool turns from start to end ($CIRC_TYPE = #BASE)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from postproc.compensation.outcome import Status
from postproc.compensation.solver.arc_turns import ArcTurns
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

BASE, PATH = "$CIRC_TYPE=#BASE", "$CIRC_TYPE=#PATH"
STEPS = 400


def turned(pose, vector):
    out = np.array(pose)
    out[:3, :3] = Rotation.from_rotvec(vector).as_matrix() @ out[:3, :3]
    return out


class Arc:
    """An arc that turns the tool by some degrees; its point between is turned apart."""

    def __init__(self, seed, deg=8.0, apart=15.0):
        rng = np.random.default_rng(seed)
        q = CENTRE + rng.uniform(-1, 1, 6) * np.deg2rad([30, 8, 8, 30, 15, 30])
        self.q, start = q, KR.flange(q[None])[0] @ tool_pose()
        normal, axis, other = (Rotation.random(random_state=rng).apply([1, 0, 0])
                               for _ in range(3))  # fmt: skip
        radius = np.cross(normal, rng.normal(size=3))
        radius *= rng.uniform(0.06, 0.12) / np.linalg.norm(radius)
        self.start, self.whole = start, np.deg2rad(rng.uniform(100, 250))
        self.normal, self.radius = normal, radius
        self.turn = np.deg2rad(deg) * axis
        self.share = rng.uniform(0.3, 0.7)
        self.via = turned(self.at(self.share), np.deg2rad(apart) * other)
        self.end = self.at(1.0)

    def at(self, share):
        """Place the tool on the arc, as a controller takes it along; shares (..)."""
        pose = np.tile(self.start, (*np.shape(share), 1, 1))
        swing = Rotation.from_rotvec(np.multiply.outer(share, self.whole * self.normal))
        pose[..., :3, 3] += swing.apply(self.radius) - self.radius
        ends = np.stack([self.start, turned(self.start, self.turn)])[:, :3, :3]
        turn = Slerp([0.0, 1.0], Rotation.from_matrix(ends))
        pose[..., :3, :3] = turn(share).as_matrix()
        return pose

    def lines(self):
        return [f"LIN {frame(self.start)}", f"CIRC {frame(self.via)},{frame(self.end)}"]

    def joints(self):
        """Follow it in small steps, (k, 6) [rad]."""
        poses = self.at(np.linspace(0, 1, STEPS)) @ np.linalg.inv(tool_pose())
        found = KR.inverse(poses).q[:, int(KR.branch(self.q[None])[0])]
        return self.q + np.angle(np.exp(1j * (found - self.q)))


@pytest.mark.parametrize("seed", range(6))
def test_the_arm_lands_where_the_arc_ends(cell, truth, model, seed):
    arc = Arc(seed)
    done, (wanted, made) = plans(job(BASE, *arc.lines()), cell, model)
    decided = done.decisions
    assert (decided.status[2:] == Status.CORRECTED).all()
    assert np.allclose(wanted.tcp[3], arc.at(arc.share), atol=2e-6)
    for k, pose in ((3, arc.at(arc.share)), (4, arc.end)):
        q = arc.joints()[round(arc.share * (STEPS - 1)) if k == 3 else -1]
        assert np.allclose(np.angle(np.exp(1j * (wanted.q[k] - q))), 0.0, atol=0.02)
        sure = decided.direction[k] != 0
        side = np.where(sure, decided.direction[k], 0.0)[None]
        tool = tool_pose()[None, :3, 3]
        really = truth.tcp(made.q[k][None], side, tool)[0]
        before = truth.tcp(wanted.q[k][None], side, tool)[0]
        assert np.linalg.norm(really - pose[:3, 3]) < 2e-5
        assert np.linalg.norm(before - pose[:3, 3]) > 3e-4


def test_sides_are_those_of_the_turning_tool(cell, model):
    sure = 0
    for seed in range(20):
        arc = Arc(seed)
        done, _ = plans(job(BASE, *arc.lines()), cell, model)
        way = arc.joints()
        last = way[-1] - way[-1 - STEPS // 20]
        clear = np.abs(last) > 3.0 * KR.play.max()
        told = done.decisions.direction[4]
        sure += int((clear & (told != 0)).sum())
        assert (told * np.sign(last) >= 0)[clear].all(), seed
    assert sure > 60


def test_what_is_written_keeps_the_orientation_between(cell, model):
    source = job(BASE, *Arc(3).lines())
    done, _ = plans(source, cell, model)
    text = done.outputs["job.src"]
    turns = [line[line.index(b"A ") :].split(b"}")[0]
             for data in (source, text) for line in data.splitlines()
             if line.startswith(b"CIRC")]  # fmt: skip
    assert turns[0] == turns[1]
    assert (points(source)[1:] != points(text)[1:]).any(axis=1).all()


LEFT = {
    "not known": [],
    "along the path": [PATH],
    "not known on one way": ["IF $IN[1] THEN", BASE, "ENDIF"],
    "a value that is not known": [BASE, "$CIRC_TYPE=N"],
}


@pytest.mark.parametrize("before", LEFT.values(), ids=LEFT)
def test_arcs_whose_turn_is_not_known_are_left(cell, model, before):
    done, _ = plans(job(*before, *Arc(3).lines()), cell, model)
    assert not (done.decisions.status[-2:] == Status.CORRECTED).any()
    assert "$CIRC_TYPE" in done.decisions.reasons[done.decisions.why[-1]].text


def test_a_start_that_is_no_single_pose_is_left(cell, model):
    begin, arc = Arc(3).lines()
    joints = "PTP {A1 12,A2 -75,A3 104,A4 24,A5 54,A6 -26}"
    done, _ = plans(job(BASE, joints, arc), cell, model)
    assert not (done.decisions.status[-2:] == Status.CORRECTED).any()
    tool = "$TOOL={X 80,Y -40,Z 170,A 0,B 0,C 0}"
    done, _ = plans(job(BASE, begin, tool, arc), cell, model)
    assert not (done.decisions.status[-2:] == Status.CORRECTED).any()


def test_half_a_turn_has_two_ways_round():
    arc = Arc(3, deg=176.0)
    poses = np.array([arc.start, arc.via, arc.end])
    one = ArcTurns(*np.array([[0], [1], [2]]))
    assert np.isnan(one.turn(poses)).all()
    poses[2] = Arc(3, deg=160.0).end
    assert not np.isnan(one.turn(poses)).any()
