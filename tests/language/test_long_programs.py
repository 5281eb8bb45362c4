"""A move more costs a row of columns: no call, no object of its own."""

import gc
import re
import sys
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.compensation.program import read_program
from postproc.language.analysis import move_blocks, task_blocks, to_visits
from postproc.language.krl import files as krl_files
from postproc.language.pdl2 import move_blocks as pdl2_blocks
from postproc.language.text.statement_table import StatementText
from tests.bench.languages import FLY, lengthened, milled, written
from tests.language.named_points import name_points
from tests.language.neutral_job import LANGUAGES

ONCE, MORE = 4_000, 9  # moves, and times
CALLS = 0.2  # of functions, for a move; longer columns are cut into more chunks
BYTES = {"job.pdl": 320, "job.mod": 380, "job.src": 320}  # at once, for a move


@pytest.fixture(scope="module")
def jobs(bench_cell):
    """Return programs of so many moves, and of many times as many, by their names."""
    texts = written(milled(bench_cell, ONCE))
    return {
        name: [own, {**own, name: lengthened(own[name], MORE)}]
        for name, own in texts.items()
    }


def calls_of(work):
    """Count the functions that are called."""
    count = 0

    def note(_frame, event, _what):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


def peak_of(work):
    """Return the most bytes that are held at once."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_move_more_is_a_row_more(name, jobs, bench_cell):
    moves = (MORE - 1) * ONCE
    read_program(jobs[name][0], bench_cell)  # what is loaded once
    for measure, most in ((calls_of, CALLS), (peak_of, BYTES[name])):
        few, many = (
            measure(lambda files=files: read_program(files, bench_cell))
            for files in jobs[name]
        )
        print(name, measure.__name__, (many - few) / moves)
        assert (many - few) / moves < most


def held(name):
    """Return the texts of a name that are in memory, by what tells them apart."""
    every = (one for one in gc.get_objects() if isinstance(one, StatementText))
    return {id(one) for one in every if one.source.name == name}


@pytest.mark.parametrize("name", ["job.mod", "job.src"])
def test_what_was_read_is_let_go_of(name, jobs, bench_cell):
    """Nothing waits for the collector of garbage, which comes late."""
    gc.collect()
    gc.disable()
    before = held(name)  # those of short programs that other tests share
    try:
        reading = read_program(jobs[name][0], bench_cell)
        assert reading.visits and held(name) <= before
    finally:
        gc.enable()


@given(st.lists(st.sampled_from([
    "\n", "\r", "\r\n", " ", "\t", "(", ")", "a", "weld", "DO", "global ", "EXT ",
    "EXT", "GLOBAL\t", ";", "=", "\xe4", "  p1(", "do x(",
])).map("".join))  # fmt: skip
def test_calls_are_found_in_lines_with_brackets(text):
    data = text.encode("latin-1")
    wanted = [(one.span(), one[1]) for one in krl_files._CALLED.finditer(data)]
    found = [(one.span(), one[1]) for one in krl_files._find_calls(data)]
    assert found == wanted
    assert all(re.search(rb"\(\Z", data[a:b]) for (a, b), _ in found)


def taught(n):
    """Write routines that each go to a point on a line that is marked as taught."""
    point = "[[500,0,500],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    lines = [f"CONST robtarget p{k}:={point};" for k in range(n)]
    lines += ["PROC main()", *(f"r{k};" for k in range(n)), "ENDPROC"]
    for k in range(n):
        lines += [f"PROC r{k}()", f"MoveL p{k},v200,fine,tool0; ! TAUGHT", "ENDPROC"]
    return {"job.mod": "\n".join(["MODULE m", *lines, "ENDMODULE", ""]).encode()}


def test_twice_the_taught_moves_take_twice_the_calls(bench_cell):
    half, whole = taught(150), taught(300)
    read_program(half, bench_cell)  # what is remembered between programs
    counts = [calls_of(lambda job=job: read_program(job, bench_cell))
              for job in (half, whole)]  # fmt: skip
    assert counts[1] < 2.3 * counts[0]


def elements_of(one):
    """Count the elements of arrays and lists, in any depth."""
    if isinstance(one, np.ndarray):
        return one.size
    return sum(map(elements_of, one)) if isinstance(one, (list, tuple)) else 1


class CountedArrays:
    """numpy, which counts the elements that its functions take and give.

    Attributes:
        elements: How many there were.
    """

    def __init__(self) -> None:
        self.elements = 0

    def __getattr__(self, name):
        made = getattr(np, name)
        if isinstance(made, type) or not callable(made) or name == "searchsorted":
            return made  # that one takes the logarithm

        def counted(*given, **options):
            found = made(*given, **options)
            self.elements += elements_of((given, found))
            return found

        return counted


def work_of(files, cell, monkeypatch, *modules):
    """Count the calls, and the elements of arrays in some modules, of reading."""
    arrays = CountedArrays()
    for module in modules:
        monkeypatch.setattr(module, "np", arrays)
    calls = calls_of(lambda: read_program(files, cell))
    monkeypatch.undo()
    return calls, arrays.elements


def measured(jobs, name, n):
    """Take the first moves of a program; each is measured, and none is like another."""
    comment = {"job.pdl": "--", "job.mod": "!", "job.src": ";"}[name]
    halt = {"job.pdl": "PAUSE", "job.mod": "Break;", "job.src": "HALT"}[name]
    files = jobs[name][0]
    moves = [*FLY.finditer(files[name])]
    own = [f"{comment} MEASURE h{k}\n{move[0].decode()}\n{halt}\n"
           for k, move in enumerate(moves[:n])]  # fmt: skip
    begin, end = moves[0].start(), moves[-1].end() + 1
    text = files[name][:begin] + "".join(own).encode() + files[name][end:]
    return {**files, name: text}


@pytest.mark.parametrize("name", LANGUAGES)
def test_twice_the_measured_moves_are_twice_the_work(
    name, jobs, bench_cell, monkeypatch
):
    """Functions of arrays are few, whatever they take: their elements count."""
    work = []
    for n in (200, 400):
        files = measured(jobs, name, n)
        work.append(work_of(files, bench_cell, monkeypatch, to_visits))
        visits = read_program(files, bench_cell).visits
        assert sum(map(bool, visits.place.measure_id)) == n
    (few, small), (many, large) = work
    assert many < 2.2 * few
    assert large < 2.2 * small


@pytest.mark.parametrize("in_array", [False, True])
@pytest.mark.parametrize("name", LANGUAGES)
def test_twice_the_named_points_are_twice_the_work(
    name, in_array, bench_cell, monkeypatch
):
    """Every move has a speed of its own where its language says one in it."""
    work = []
    for n in (200, 400):
        files = name_points(written(milled(bench_cell, n))[name], name, in_array)
        first, *moves = files[name].split(b",vWork,zone1,")
        slower = (b",vWork\\V:=%d,zone1," % k + one for k, one in enumerate(moves))
        files[name] = b"".join([first, *slower])
        read_program(files, bench_cell)
        modules = to_visits, move_blocks, task_blocks, pdl2_blocks
        work.append(work_of(files, bench_cell, monkeypatch, *modules))
    (few, small), (many, large) = work
    assert many < 2.2 * few
    assert large < 2.2 * small
