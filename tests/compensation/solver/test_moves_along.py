"""Targets that are left and move all the same: their reasons say so."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.program import plan_visits, read_program
from postproc.compensation.solver.dependants import WITH_BEGIN, WITH_POINT
from postproc.report.simulation import setup_of
from postproc.simulation import land, virtual_arm
from tests.conftest import SEED
from tests.language.krl.test_clones import SIDES
from tests.language.krl.test_clones import moves as krl_job
from tests.language.rapid.test_clones import TWICE, P
from tests.language.rapid.test_clones import moves as rapid_job
from tests.written import program

SHIFTED = "MoveL Offs(pShared,0,0,n+30),vWork,fine,tWork\\WObj:=wPart;"
N = "  CONST num n:=5;\n"
CASES = {
    "steps": ("krl", [SIDES[0], "PTP XP9", "LIN_REL {Z 5}", "LIN_REL {X 5}"]),
    "a step behind a move that is left": (
        "krl", [SIDES[0], "PTP XP9", "PTP {A6 20}", "LIN_REL {Z 5}"]),
    "a shift that is computed": (
        "rapid", [TWICE[0], TWICE[1].format("pShared", ""), SHIFTED]),
    "a shift of a point that stays": ("rapid", [TWICE[0], SHIFTED]),
    "nothing moves": ("krl", ["$ORI_TYPE=#CONSTANT", "PTP XP9", "LIN XP9"]),
}  # fmt: skip


LANDED = {
    "POS_SHIFT": (
        "pdl2", ["MOVE JOINT TO {5, 10, -95, 20, 50, 30}", "MOVE LINEAR TO p",
                 "MOVE LINEAR TO r", "MOVE LINEAR TO POS_SHIFT(p, VEC(0, 0, 30))"]),
    "Offs": ("rapid", [TWICE[0], TWICE[1].format("pShared", ""), SHIFTED]),
    "a geometric sum": (
        "krl", [SIDES[0], "PTP XP9", "LIN XP9:{X 0,Y 0,Z -2*15,A 0,B 0,C 0}"]),
}  # fmt: skip


def files_of(language, cell, lines):
    if language == "krl":
        return krl_job(cell, *lines)
    if language == "pdl2":
        points = ("100, 200, 150, 0, 175, 0, ''", "160, 260, 120, 0, 170, 0, ''")
        given = [f"{n} := POS({at})" for n, at in zip("pr", points, strict=True)]
        return {"job.pdl": program(*given, *lines)}
    return {"job.mod": rapid_job(cell, *lines, declared=P + N)}


@pytest.mark.parametrize(("language", "lines"), CASES.values(), ids=CASES)
def test_a_reason_says_that_a_target_moves(bench_cell, bench_model, language, lines):
    files = files_of(language, bench_cell, lines)
    name = next(iter(files))
    pages = {other: text for other, text in files.items() if other != name}
    found = compensate(
        files[name], bench_cell, bench_model, name=name, pages=pages, options=Options()
    )
    before, after = (
        plan_visits(read_program(text, bench_cell).visits, bench_cell)
        for text in (files, {**files, **found.outputs})
    )
    way = after.plan.tcp[:, :3, 3] - before.plan.tcp[:, :3, 3]
    moved = np.nan_to_num(np.linalg.norm(way, axis=1)) > 1e-5
    d = found.decisions
    for v in np.flatnonzero(d.status != Status.CORRECTED).tolist():
        reason = d.reasons[d.why[v]].text
        assert (
            WITH_POINT in reason
            or WITH_BEGIN in reason
            or "does not state all" in reason
        ) == (bool(moved[v]) or "does not state all" in reason), reason


@pytest.mark.parametrize(
    ("case", "text"),
    [("steps", WITH_BEGIN), ("a shift that is computed", WITH_POINT)],
)
def test_what_moves_along_is_named(bench_cell, bench_model, case, text):
    language, lines = CASES[case]
    files = files_of(language, bench_cell, lines)
    name = next(iter(files))
    pages = {other: data for other, data in files.items() if other != name}
    d = compensate(
        files[name], bench_cell, bench_model, name=name, pages=pages
    ).decisions
    assert any(text in reason.text for reason in d.reasons), d.reasons


@pytest.mark.parametrize(("language", "lines"), LANDED.values(), ids=LANDED)
def test_the_error_is_expected_that_the_arm_has(
    bench_cell, bench_model, language, lines
):
    files = files_of(language, bench_cell, lines)
    name, *others = files
    pages = {other: files[other] for other in others}
    found = compensate(files[name], bench_cell, bench_model, name=name, pages=pages)
    before, after = (
        read_program(text, bench_cell).visits
        for text in (files, {**files, **found.outputs})
    )
    setup = setup_of(bench_cell)
    landing = land(virtual_arm(SEED, tool=setup.tool), setup, before, after)
    d, expected = found.decisions, found.expected
    rows = landing.visit[d.status[landing.visit] == Status.RUNTIME]
    missed = np.linalg.norm(landing.error, axis=1)[np.isin(landing.visit, rows)]
    assert len(rows) == 1
    assert missed < 0.5 * expected.before[rows]
    np.testing.assert_allclose(expected.after[rows], missed, atol=5e-5)
    assert missed < expected.high[rows]
