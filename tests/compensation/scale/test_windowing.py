"""A program that is corrected window by window comes out as if it were corrected whole.

To the byte: output, report and record. Whether cuts lie inside fly runs or at stops,
what is next to them, and how many processes work on it, makes no difference.
"""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from postproc.compensation import pipeline
from postproc.compensation.compensate import compensate
from postproc.compensation.options import DEFAULT_OPTIONS, Clock, Job, no_progress
from postproc.compensation.outcome import Outcome, Status
from postproc.compensation.program import plan_visits, read_program
from postproc.compensation.scale import window_work, workers
from postproc.compensation.scale import windowing as cuts
from postproc.compensation.window_result import example_of
from postproc.model.model import Model
from postproc.report.json import report_text
from tests.bench import made
from tests.bench.languages import milled, written
from tests.slow import slow

LEAST, HALO, BAND, RUN_UP = 90, 80, 24, 200
FLY = "  MOVEFLY LINEAR TO POS({}, 'W T1:0 T2:0 T3:0') ADVANCE"
FAR = "9000.0000, 0.0000, 0.0000, 0.0000, 180.0000, 0.0000"


@pytest.fixture
def job(bench_cell, bench_model, monkeypatch):
    def run(program: made.Made, least: int = LEAST, processes: int = 1) -> Outcome:
        monkeypatch.setattr(cuts, "LEAST", least)
        return compensate(
            program.source,
            bench_cell,
            bench_model,
            name=program.name,
            variables=program.variables,
            processes=processes,
        )

    for name, value in (("HALO", HALO), ("BAND", BAND), ("RUN_UP", RUN_UP)):
        monkeypatch.setattr(cuts, name, value)
    monkeypatch.setattr(made, "ROW", 40)
    return run


@pytest.fixture
def joined(monkeypatch) -> list[int]:
    """Collect how many windows every program was put together from."""
    found: list[int] = []
    original = window_work.complete_room

    def watched(whole, parts, ends):
        found.append(len(parts))
        return original(whole, parts, ends)

    monkeypatch.setattr(window_work, "complete_room", watched)
    return found


def told(outcome: Outcome) -> tuple[object, ...]:
    """Return all that is written, but for the seconds."""
    report = report_text(outcome).partition('"stages_s"')[0]
    return outcome.outputs, outcome.sidecar, report


def run_of(n: int, change=None) -> made.Made:
    """Make one fly run, some of its lines replaced."""
    program = made.milling(n)
    lines = program.source.decode().splitlines()
    rows = [k for k, line in enumerate(lines) if "MOVEFLY" in line]
    for nth, k in enumerate(rows):
        if change is not None:
            lines[k] = change(nth, lines[k])
    return made.Made(program.name, "\n".join([*lines, ""]).encode())


def numbers(line: str) -> list[float]:
    return [float(x) for x in line.partition("POS(")[2].partition(",'")[0].split(",")]


def place(line: str, *by: float) -> str:
    own = numbers(line)
    moved = [x + d for x, d in zip(own, (*by, *[0.0] * 6), strict=False)]
    return ", ".join(f"{x:.4f}" for x in moved)


def dwelling(nth: int, line: str) -> str:
    """Stand at points: the same one again, and again."""
    return "\n".join([line] * (3 if nth % 37 < 3 else 1))


def reversing(nth: int, line: str) -> str:
    """Go back a little after every few points."""
    return line if nth % 5 else "\n".join([line, FLY.format(place(line, -3.0)), line])


def in_arcs(nth: int, line: str) -> str:
    """Go some of the way in arcs."""
    if nth % 11:
        return line
    via, end = place(line, 0.7, 0.6, 0.5), place(line, 1.4, 0.0, 0.9)
    return f"{line}\n  MOVEFLY CIRCULAR TO POS({end}, '') VIA POS({via}, '') ADVANCE"


def changing(nth: int, line: str) -> str:
    """Change what holds along the run."""
    own = (
        f"  $FLY_DIST := {0.2 + 0.1 * (nth % 9):.4f}",
        f"  $LIN_SPD := {0.02 + 0.01 * (nth % 7):.4f}",
        "  $FLY_TYPE := FLY_NORM\n  $FLY_PER := 40",
        "  $FLY_TYPE := FLY_CART",
    )
    return "\n".join([own[nth // 13 % 4], line]) if nth % 13 == 0 else line


def leaving(nth: int, line: str) -> str:
    """Leave a point out of reach, so that what is next to it is left too."""
    return FLY.format(FAR) if nth in (LEAST - 1, 3 * LEAST + 1, 700) else line


def shared(nth: int, line: str) -> str:
    """Come to the same number of the program again, a little later."""
    again = "  MOVEFLY LINEAR TO p ADVANCE"
    value = f"  p := POS({place(line)}, '')"
    return line if nth % 50 else "\n".join([value, again, line, again])


def by_joints(nth: int, line: str) -> str:
    """Swing over in between."""
    return line.replace("LINEAR", "JOINT") if nth % 29 < 2 else line


def stopping(nth: int, line: str) -> str:
    """Name another branch here and there, where the controller checks it."""
    if nth not in (LEAST - 1, 3 * LEAST + 1, 700):
        return line
    named = line.replace("''", "'W'")
    return f"  $CNFG_CARE := TRUE\n{named}\n  $CNFG_CARE := FALSE"


MORE = [stopping, dwelling, in_arcs, changing, shared, by_joints]


@pytest.mark.parametrize("change", [None, reversing, leaving, *slow(MORE)])
def test_inside_runs_windows_change_no_byte(job, joined, change) -> None:
    program = run_of(900, change)
    if change is shared:
        source = program.source.replace(b"ROUTINE", b"VAR p : POSITION\nROUTINE", 1)
        program = made.Made(program.name, source)
    whole = job(program, 10_000)
    assert whole.decisions.count(Status.CORRECTED) > (
        400 if change is not leaving else 0
    )
    wanted = told(whole)
    for least in (90, 230):
        assert told(job(program, least)) == wanted
    assert told(job(program, 131, processes=2)) == wanted
    if change not in (leaving, shared):  # one window where things reach so far
        assert min(joined) > 2


@pytest.mark.parametrize("kind", ["spot", "milling", *slow(["drilling", "handling"])])
def test_between_stops_windows_change_no_byte(job, joined, monkeypatch, kind) -> None:
    monkeypatch.setattr(made, "ROWS", 3)
    program = made.KINDS[kind](600)
    wanted = told(job(program, 10_000))
    for least in (90, 170):
        assert told(job(program, least)) == wanted
    assert told(job(program, 90, processes=2)) == wanted
    assert min(joined) > 2


def test_time_laws_are_found_for_whole_runs(job, monkeypatch, joined) -> None:
    monkeypatch.setattr(made, "ROWS", 3)
    monkeypatch.setattr(Model, "needs", property(lambda _: frozenset({"speed"})))
    program = made.milling(900)
    wanted = told(job(program, 10_000))
    assert told(job(program, 150)) == wanted and min(joined) > 2
    assert told(job(program, 150, processes=2)) == wanted


def test_threads_do_the_same_where_there_is_no_fork(job, monkeypatch, joined) -> None:
    monkeypatch.setattr(workers, "can_fork", lambda: False)
    program = run_of(900, reversing)
    wanted = told(job(program, 10_000))
    assert told(job(program, 131, processes=2)) == wanted and min(joined) > 2


def test_a_halo_that_is_too_small_is_found_out(job, monkeypatch, joined) -> None:
    program = run_of(700, reversing)
    wanted = told(job(program, 10_000))
    for halo, band in ((30, 20), (24, 18)):
        monkeypatch.setattr(cuts, "HALO", halo)
        monkeypatch.setattr(cuts, "BAND", band)
        assert told(job(program, 60)) == wanted


def test_rounds_are_those_of_the_whole_program(job, joined) -> None:
    """Half of the program is at rest at once, the other half is not."""

    def half(nth: int, line: str) -> str:
        return line if nth < 450 else reversing(nth, line)

    program = run_of(900, half)
    wanted = told(job(program, 10_000))
    assert told(job(program)) == wanted and min(joined) > 2


def test_doubt_about_a_branch_goes_on_behind_a_cut(job, joined) -> None:
    program = made.drilling(400)
    # The program asks, at a target in the first window, not to check its branch.
    source = program.source.replace(b"'T1:0 T2:0')", b"'W T1:0 T2:0')")
    source = source.replace(b"BEGIN\n", b"BEGIN\n  $CNFG_CARE := FALSE\n", 1)
    assert source != program.source
    program = made.Made(program.name, source)
    whole, cut = job(program, 10_000), job(program)
    assert told(cut) == told(whole) and joined[-1] > 2
    behind = cut.decisions.why[200:]
    assert (behind > 0).all()
    assert "uncertain" in cut.decisions.reasons[behind[0]].text


def test_one_window_is_in_memory_at_a_time(job, monkeypatch, joined) -> None:
    original, plans, alive = pipeline.plan_visits, [], []

    def watched(*given):
        gc.collect()
        alive.append(sum(plan() is not None for plan in plans))
        planned = original(*given)
        plans.extend(map(weakref.ref, (planned, planned.plan, planned.targets)))
        return planned

    monkeypatch.setattr(pipeline, "plan_visits", watched)
    job(made.drilling(600))
    assert joined[-1] > 4 and len(alive) > 4 and not any(alive)


def test_what_was_looked_at_last_is_what_is_read_from_the_output(
    job, bench_cell
) -> None:
    outcome = job(made.drilling(400))
    again = read_program(dict(outcome.outputs), bench_cell).visits
    np.testing.assert_array_equal(again.target.values, outcome.decisions.corrected)


def test_where_a_window_begins_is_foretold_though_lines_tell_no_branch(
    bench_cell, bench_model
):
    texts = written(milled(bench_cell, 300))["job.src"]
    reading = read_program(texts, bench_cell)
    setting = Job(bench_cell, bench_model, DEFAULT_OPTIONS, Clock(no_progress), 1)
    quiet = np.ones(len(reading.visits), dtype=bool)
    room = example_of(6, turned=False)
    work = window_work._WindowWork(
        reading, setting, pipeline.correct_visits, quiet, quiet, room
    )
    whole = plan_visits(reading.visits, bench_cell, False).plan.exact
    for visit in (120, 250):
        found = work._foretell(visit)
        assert found.slot == whole.slot[visit] >= 0
        np.testing.assert_allclose(found.q[0], whole.q[visit], rtol=0, atol=1e-9)
    assert len(reading.visits) > 250


def test_joints_that_rest_for_longer_than_a_halo_agree(
    job, monkeypatch, joined, bench_cell, bench_model
) -> None:
    """Along a row, some joints remember where they lie in their play all the way."""
    texts = written(milled(bench_cell, 2500))["job.pdl"]
    program = made.Made("job.pdl", texts["job.pdl"])
    wanted = told(job(program, 10_000))
    assert told(job(program, 600)) == wanted and joined == [4]
