"""Whoever approaches a target as advised reaches it from sides that are sure."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.approach_advice import (
    ASIDE,
    SHORT,
    place_to_approach,
)
from postproc.compensation.options import Options
from postproc.compensation.program import read_program
from postproc.compensation.solver.targets import targets_from_visits
from postproc.motion.cycle_time import run
from postproc.robot.direction import half_width
from postproc.robot.trajectory import Motion

TIMED = Options(timing=True)
START = "MOVE JOINT TO {4.0, -6.0, -84.0, 9.0, 53.0, -12.0}"
HOLES = 60


def job(back: dict[int, float]) -> bytes:
    """Approach places from 0.4 mm above, or from farther back."""
    rng, moves = np.random.default_rng(8), []
    for k in range(HOLES):
        x, y, z = rng.uniform((-200, -250, 20), (200, 100, 120))
        turn = ", ".join(
            f"{v:.3f}" for v in rng.uniform((75, 158, -30), (105, 166, 30))
        )
        for height in (0.4 + back.get(k, 0.0), 0.0):
            kind = "LINEAR" if height == 0 else "JOINT"
            moves.append(
                f"  MOVE {kind} TO POS({x:.3f}, {y:.3f}, {z + height:.3f}, {turn}, '')"
            )
    lines = ["PROGRAM job", "BEGIN", START, *moves, "END job", ""]
    return "\n".join(lines).encode()


@pytest.fixture(scope="module")
def advice(bench_cell, bench_model):
    """Ask for the advice on the holes of a job, by hole."""

    def ask(back: dict[int, float]) -> dict[int, float]:
        found = compensate(job(back), bench_cell, bench_model, options=TIMED)
        told = {}
        for d in found.diagnostics:
            if d.code == "direction-uncertain" and (hole := (d.line - 4) // 2) >= 0:
                moved = re.search(
                    r"start the approach (\d+) mm farther back", d.message
                )
                if moved and d.line % 2:
                    told[hole] = float(moved[1])
        return told

    return ask


def test_who_approaches_as_advised_is_sure_of_all_sides(advice) -> None:
    first = advice({})
    assert 10 <= len(first) <= 50
    again = advice(first)
    assert len(set(again) & set(first)) <= 0.1 * len(first)


def test_a_first_move_is_told_what_to_do_before_it(bench_cell, bench_model) -> None:
    source = job({}).replace(f"{START}\n".encode(), b"")
    found = compensate(source, bench_cell, bench_model, options=TIMED)
    told = [d.message for d in found.diagnostics if d.code == "direction-uncertain"]
    assert any("before it, add a JOINT move" in text for text in told)
    plain = compensate(source, bench_cell, bench_model)
    texts = [d.message for d in plain.diagnostics if d.code == "direction-uncertain"]
    assert all("start the approach farther away" in text for text in texts)


def test_a_place_to_come_from_is_on_the_way_and_behind(bench_cell) -> None:
    arm = bench_cell.arm
    visits = read_program({"job.pdl": job({})}, bench_cell).visits
    cycle = run(arm, targets_from_visits(visits, bench_cell)[0])
    tool, unsure, found = cycle.targets.tool[0, :3, 3], np.zeros(6, dtype=bool), 0
    unsure[:3] = True

    def place(q: np.ndarray) -> np.ndarray:
        return arm.tcp(q[None], tool[None])[0]

    for row in np.flatnonzero(visits.motion.kind == Motion.LINEAR)[1:].tolist():
        before = int(visits.graph.before[row])
        most = 8e-3
        q = place_to_approach(arm, cycle, row, before, unsure, most)
        if q is None:
            continue
        found += 1
        begin, above, end = cycle.path.q[[visits.graph.before[before], before, row]]
        share = (q - begin) @ (above - begin) / ((above - begin) @ (above - begin))
        assert 0.0 <= share <= 1.0  # that move is a JOINT move: straight in its joints
        np.testing.assert_allclose(q, begin + share * (above - begin), atol=1e-6)
        off = place(q) - place(end)
        assert SHORT <= np.linalg.norm(off) <= most
        assert off @ (place(end) - place(above)) <= 1e-12
        turned = np.abs(arm.coupling @ (end - q))
        assert (turned >= 2 * half_width(arm))[unsure].all()
        line = off / np.linalg.norm(off)
        for k in np.linspace(share, 1.0, 20):
            rel = place(begin + k * (above - begin)) - place(end)
            assert np.linalg.norm(rel - (rel @ line) * line) <= ASIDE + 1e-6
    assert found >= 10


def test_there_is_no_place_to_come_from_where_the_way_is_not_known(bench_cell) -> None:
    visits = read_program({"job.pdl": job({})}, bench_cell).visits
    cycle = run(bench_cell.arm, targets_from_visits(visits, bench_cell)[0])
    unsure = np.ones(6, dtype=bool)
    assert place_to_approach(bench_cell.arm, cycle, 1, 0, unsure, 8e-3) is None
