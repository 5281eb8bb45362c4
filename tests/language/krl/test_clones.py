"""Points of KRL that moves share, and points of their own for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.output.sidecar import restore
from postproc.compensation.program import read_program
from postproc.report.simulation import setup_of
from postproc.simulation import land, virtual_arm
from tests.conftest import SEED
from tests.fuzz.case import records_of
from tests.language.neutral_job import drawn, krl

CLONE, EXPORTED = (
    Options(shared_points="clone"),
    Options(shared_points="clone", edit_exported=True),
)


def run(files, cell, model, options=CLONE):
    pages = {name: text for name, text in files.items() if name != "job.src"}
    source = files["job.src"]
    return compensate(source, cell, model, name="job.src", pages=pages, options=options)


def notes(outcome, code):
    return [d.message for d in outcome.diagnostics if d.code == code]


def corrected(outcome):
    return int((outcome.decisions.status == Status.CORRECTED).sum())


def shared(cell, seed):
    """Return a job that goes to its named points twice, from different sides."""
    job = drawn(cell, seed, 16)
    moves = [replace(m, name=f"Q{k}") if not m.in_joints and m.via is None else m
             for k, m in enumerate(job.moves)]  # fmt: skip
    again = [m for m in reversed(moves) if m.name]
    return krl(replace(job, moves=(*moves, *again)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_arm_lands_where_it_is_to(bench_cell, bench_model, seed):
    files = shared(bench_cell, seed)
    plain = run(files, bench_cell, bench_model, Options(shared_points="leave"))
    found = run(files, bench_cell, bench_model)
    assert corrected(found) > corrected(plain) + 10 and notes(found, "cloned")
    records = records_of(found.sidecar)
    for name, output in found.outputs.items():
        assert restore(output, records[name], name) == files[name]
    setup = setup_of(bench_cell)
    body = virtual_arm(SEED, tool=setup.tool)
    given, made = (
        read_program(text, bench_cell).visits
        for text in (files, {**files, **found.outputs})
    )
    landing, rows = land(body, setup, given, made), found.decisions
    safe = (rows.why == 0) & ~found.visits.motion.fly & ~found.visits.motion.via
    sure = (safe & (rows.direction != 0).all(axis=1))[landing.visit]
    miss = 1e3 * np.linalg.norm(landing.error, axis=1)[sure & (landing.visit > 0)]
    assert len(miss) > 10 and miss.max() <= 0.1


SIDES = ("PTP {A1 25,A2 -20,A3 -100,A4 20,A5 40,A6 10}",
         "PTP {A1 15,A2 -30,A3 -120,A4 40,A5 60,A6 30}")  # fmt: skip


def moves(cell, *lines, data="DECL E6POS XP9={#} ; seam", more="", **others):
    """Write a job whose lines stand behind some moves; # are numbers of a point."""
    job = drawn(cell, 1, 8)
    named = next(m for m in job.moves if not m.in_joints and m.via is None)
    files = krl(replace(job, moves=[replace(named, name="P9")]))
    declared = files["job.dat"].decode()
    point = next(x for x in declared.splitlines() if "XP9" in x)
    numbers = point[point.index("{") + 1 : point.rindex("}")]
    text = files["job.src"].decode()
    head = text[: text.index("$CIRC_MODE")]
    files["job.src"] = "\r\n".join([*head.splitlines(), *lines, "END", more]).encode()
    list_ = declared.replace(point, data.replace("#", numbers).replace("\n", "\r\n"))
    files["job.dat"] = list_.encode()
    return files | {
        name.replace("_", "."): text.replace("#", numbers).encode()
        for name, text in others.items()
    }


def twice(name="XP9", fold=""):
    begin, end = ([fold], [";ENDFOLD"]) if fold else ([], [])
    return [SIDES[0], *begin, f"PTP {name} ; here", *end, SIDES[1], *begin,
            f"PTP {name}", *end]  # fmt: skip


def test_what_is_written(bench_cell, bench_model):
    files = moves(bench_cell, *twice())
    found = run(files, bench_cell, bench_model)
    source, list_ = (found.outputs[f"job.{s}"].decode() for s in ("src", "dat"))
    assert notes(found, "cloned") == ["XP9: the moves of lines 10 go to xp9__2 now"]
    assert source.count("PTP XP9 ; here\r\n") == source.count("PTP XP9__2\r\n") == 1
    lines = list_.split("\r\n")
    at = next(k for k, line in enumerate(lines) if line.startswith("DECL E6POS XP9={"))
    assert lines[at].endswith("} ; seam")
    assert lines[at + 1].startswith("DECL E6POS XP9__2={X ")
    assert lines[at + 1].endswith("}") and "GLOBAL" not in lines[at + 1]


FORMS = {
    "a value of its own": "DECL E6POS XP9\nXP9={#}",
    "known to all": "DECL GLOBAL E6POS XP9={#}",
    "behind other data": "DECL E6POS XA,XP9\nINT N\nXP9={#}",
    "upper and lower case": "decl e6pos xp9={#}",
}


@pytest.mark.parametrize("data", FORMS.values(), ids=FORMS)
def test_every_way_of_declaring_a_point(bench_cell, bench_model, data):
    files = moves(bench_cell, *twice(), data=data)
    found = run(files, bench_cell, bench_model, EXPORTED)
    assert len(notes(found, "cloned")) == 1, notes(found, "not-cloned")
    assert found.outputs["job.dat"].count(b"9__2=") == 1


def test_all_elements_of_an_array_are_cloned(bench_cell, bench_model):
    data = "DECL E6POS XS[3]\nXS[1]={#}\nXS[3]={#}\nDECL INT N=2"
    lines = [x for k in (1, 3) for x in (SIDES[0], f"PTP XS[{k}]")]
    lines += [x for k in (3, 1) for x in (SIDES[1], f"PTP XS[{k}]")]
    found = run(moves(bench_cell, *lines, data=data), bench_cell, bench_model)
    list_ = found.outputs["job.dat"].decode()
    lines = list_[list_.index("XS[3]={") :].split("\r\n")[1:4]
    assert lines[0] == "DECL E6POS XS__2[3]"
    assert [line[:9] for line in lines[1:]] == ["XS__2[1]=", "XS__2[3]="]
    assert corrected(found) == len(found.visits)


def test_a_point_that_something_reads_stays_and_its_move_gets_another(
    bench_cell, bench_model
):
    lines = [SIDES[0], "PTP XP9", "R=XP9.Z"]
    data = "DECL E6POS XP9={#}\nDECL REAL R"
    files = moves(bench_cell, *lines, data=data)
    assert corrected(run(files, bench_cell, bench_model, Options())) == 1
    found = run(files, bench_cell, bench_model)
    assert corrected(found) == 2 and notes(found, "cloned")
    point = next(x for x in files["job.dat"].splitlines() if b"XP9=" in x)
    assert point in found.outputs["job.dat"]


ABROAD = "DEFDAT more PUBLIC\nDECL GLOBAL E6POS XP9={#}\nENDDAT\n"
CONFIG = "DEFDAT $CONFIG\nDECL E6POS XP9={#}\nENDDAT\n"
CALLED = "DEF more( )\nEND\n"
LONG = "X" + 21 * "L"
FORM = ";FOLD PTP P9 Vel=100 % PDAT1;%{PE}%MKUKATPBASIS,%CMOVE,%VPTP,%P 1:PTP, 2:P9"
NEW = ";FOLD PTP P9\n;Params IlfProvider=kukaroboter.inlineforms; Kuka.PointName=P9"
STAYING = {
    "of an inline form": (twice(fold=FORM), {}, "inline form"),
    "of a newer inline form": (twice(fold=NEW), {}, "inline form"),
    "of the controller": (twice(), {"data": "", "$config_dat": CONFIG}, ""),
    "a home position": (twice("XHOME"), {"data": "DECL E6POS XHOME={#}"}, ""),
    "a long name": (twice(LONG), {"data": f"DECL E6POS {LONG}={{#}}"}, "longer than"),
    "declared with other data": (
        twice(), {"data": "DECL E6POS XP9={#},XP8={#}"}, "other data"),
    "a parameter": (
        [SIDES[0], "go(XP9)", SIDES[1], "go(XP9)"],
        {"more": "DEF go(P:IN)\nE6POS P\nPTP P\nEND\n"}, ""),
    "two moves on a line": (
        twice("XP9[N]"),
        {"data": "DECL INT N=1\nDECL E6POS XP9[N]\nXP9[1]={#}"}, "is no number"),
}  # fmt: skip


@pytest.mark.parametrize(("lines", "given", "why"), STAYING.values(), ids=STAYING)
def test_what_is_not_cloned_keeps_every_byte(
    bench_cell, bench_model, lines, given, why
):
    files = moves(bench_cell, *lines, **given)
    found = run(files, bench_cell, bench_model)
    assert not notes(found, "cloned") and b"__2" not in b"".join(found.outputs.values())
    told = notes(found, "not-cloned")
    assert why in " ".join(told) and (told or not why)


def test_a_plain_fold_is_no_form(bench_cell, bench_model):
    lines = twice(fold=";FOLD the seam")
    found = run(moves(bench_cell, *lines), bench_cell, bench_model)
    assert len(notes(found, "cloned")) == 1


def test_a_point_of_another_list_is_known_to_its_moves(bench_cell, bench_model):
    others = {"more_dat": ABROAD, "more_src": CALLED}
    files = moves(bench_cell, *twice(), "more( )", data="", **others)
    found = run(files, bench_cell, bench_model, EXPORTED)
    assert len(notes(found, "cloned")) == 1, found.diagnostics
    assert b"DECL GLOBAL E6POS XP9__2={" in found.outputs["more.dat"]


def test_a_point_that_other_programs_know_stays_and_its_move_gets_another(
    bench_cell, bench_model
):
    others = {"more_dat": ABROAD, "more_src": CALLED}
    files = moves(bench_cell, SIDES[0], "PTP XP9", data="", **others)
    plain = run(files, bench_cell, bench_model, Options())
    found = run(files, bench_cell, bench_model)
    assert corrected(plain) == 1 and corrected(found) == 2
    point = next(x for x in files["more.dat"].splitlines() if b"XP9=" in x)
    assert (
        point in found.outputs["more.dat"] and b"PTP XP9__2" in found.outputs["job.src"]
    )
    again = read_program({**files, **found.outputs}, bench_cell).visits
    assert again.target.names[again.target.name[1]] == "xp9__2"


def test_of_an_inline_form_such_a_point_is_left(bench_cell, bench_model):
    others = {"more_dat": ABROAD, "more_src": CALLED}
    lines = [SIDES[0], FORM, "PTP XP9", ";ENDFOLD"]
    files = moves(bench_cell, *lines, data="", **others)
    found = run(files, bench_cell, bench_model)
    assert corrected(found) == 1 and "more.dat" not in found.outputs
    reason = found.decisions.reasons[found.decisions.why[1]]
    assert "other programs may read" in reason.text


def test_a_point_that_a_submit_program_sets_is_not_cloned(bench_cell, bench_model):
    beside = "DEF sps( )\nLOOP\nXP9.Z=5\nENDLOOP\nEND\n"
    others = {"more_dat": ABROAD, "more_src": CALLED, "sps_sub": beside}
    files = moves(bench_cell, SIDES[0], "PTP XP9", data="", **others)
    found = run(files, bench_cell, bench_model)
    assert corrected(found) == 1 and not notes(found, "cloned")
