"""Curves through many points (KRL's spline blocks) are corrected whole, or left."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from postproc.compensation.outcome import Status
from postproc.compensation.solver.continuity import CURVE
from postproc.robot.cell import load_cell
from tests.compensation.curved import (
    CELL,
    CENTRE,
    KR,
    drawn_arm,
    frame,
    job,
    plans,
    surveyed,
    tool_pose,
)

GAP = np.full(6, 3e-4)  # [rad] half the gap of every gear


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text(CELL + "[limits]\ncorrection_mm = 8.0\n")
    return load_cell(path)


@pytest.fixture(scope="module")
def truth():
    return drawn_arm(26)


@pytest.fixture(scope="module")
def model(truth):
    return surveyed(truth, 27)


def block(rng: np.random.Generator) -> list[str]:
    """Write a line to a curve of ten points, smooth in the joints, and the curve."""
    at, q = np.linspace(0.0, 1.0, 11)[:, None], np.tile(CENTRE, (11, 1))
    for turns in (0.3, 0.7):
        phase = rng.uniform(0, 2 * np.pi, 6)
        q += 0.08 * rng.normal(size=6) * np.sin(2 * np.pi * turns * at + phase)
    poses = KR.flange(q) @ tool_pose()
    return [
        f"SLIN {frame(poses[0])}",
        "SPLINE",
        *[f"SPL {frame(pose)}" for pose in poses[1:]],
        "ENDSPLINE",
    ]


def really_arrives(q: np.ndarray, first: int, side: np.ndarray) -> np.ndarray:
    """Follow the gaps of all gears along the curve of a controller, (10, 6).

    It is smooth up to its curvature; the sides are those at its points behind the
    first. Between them joints are as cubic splines in the distance have them.
    """
    drive = q[first : first + 11] @ KR.coupling.T
    place = (KR.flange(q[first : first + 11]) @ tool_pose())[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
    at = np.linspace(0.0, way[-1], 4000)
    at = np.sort(np.append(at, way))
    path = CubicSpline(way, drive, bc_type="natural")(at)
    found, last = [], path[0]
    for u, angle in zip(at, path, strict=True):
        side = np.clip(side + (angle - last) / GAP, -1.0, 1.0)
        last = angle
        if u in way:
            found.append(side)
    return np.array(found)[-10:]


def test_a_whole_curve_lands_where_it_should(cell, truth, model):
    rng = np.random.default_rng(28)
    lines = [line for _ in range(6) for line in block(rng)]
    done, (wanted, made) = plans(job(*lines), cell, model)
    decided = done.decisions
    curves = (decided.status[2:] == Status.CORRECTED).reshape(6, 11)
    assert np.isin(curves.sum(axis=1), (0, 11)).all()
    assert curves.all(axis=1).sum() >= 4
    tool = np.tile(cell.tool.pose[:3, 3], (10, 1))
    sure, unsure, before = [], [], []
    for k in np.flatnonzero(curves.all(axis=1)):
        first = 2 + 11 * int(k)
        own = slice(first + 1, first + 11)
        side = really_arrives(made.q, first, made.side[first])
        asked = wanted.tcp[own, :3, 3]
        landed = truth.tcp(made.q[own], side, tool)
        off = np.linalg.norm(landed - asked, axis=1)
        told = (np.abs(made.direction[own]) == 1).all(axis=1)
        sure += off[told].tolist()
        unsure += off[~told].tolist()
        plain = truth.tcp(wanted.q[own], side, tool)
        before += np.linalg.norm(plain - asked, axis=1).tolist()
    assert len(sure) > 15
    assert np.median(sure) < 1e-5 and np.mean(sure) < 3e-5 and np.max(sure) < 2e-4
    assert np.mean(unsure) < 1.5e-4 and np.max(unsure) < 3.5e-4
    assert np.mean(before) > 3e-3


@pytest.mark.parametrize("point", [0, 4, 10])
def test_a_point_that_is_left_leaves_its_curve_and_its_start(cell, model, point):
    lines = block(np.random.default_rng(29))
    lines[point + (point > 0)] += " ; TAUGHT"
    done, _ = plans(job(*lines), cell, model)
    decided = done.decisions
    assert not (decided.status[2:] == Status.CORRECTED).any()
    other = 3 if point == 0 else 2
    assert decided.reasons[decided.why[other]] == CURVE
