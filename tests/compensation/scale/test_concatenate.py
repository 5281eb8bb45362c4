"""Programs side by side: every visit says what it says in its own program."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.compensation.program import read_program
from postproc.compensation.scale.concatenate import concatenate, first_visits
from postproc.language.visits import Visits
from tests.bench.made import spot
from tests.generated.landing import program

SEEDS = range(40)
TOLD = (  # columns that mean the same wherever they stand
    "line", "kind", "meaning", "via", "distance_mm", "config_given", "tool_remote",
    "nearest_turn", "care", "fly", "size_mm", "overlap_percent", "blend", "rule",
    "linear", "turning", "override", "wrist_joint", "orientation_law",
    "arc_angle", "curved",
)  # fmt: skip
LOOKED_UP = (
    ("target", "config", "configs"), ("target", "name", "names"),
    ("frame", "tool", "poses"), ("frame", "base", "poses"),
    ("frame", "uframe", "poses"),
)  # fmt: skip


@pytest.fixture(scope="module")
def programs(job_cell):
    made = [program(seed)[0].files for seed in SEEDS]
    return [v for files in made if len(v := read_program(files, job_cell).visits)]


def told(visits: Visits, v: int, first: int) -> list[object]:
    """Tell one visit of a program that begins at `first` without any index."""
    told: list[object] = [visits.columns[name][v].tolist() for name in TOLD]
    told += [visits.file_name(v), visits.reasons[visits.reason[v]]]
    told += [visits.target.values[v].tolist(), visits.place.measure_id[v]]
    told.append([x for x in visits.target.aux[v].tolist() if x == x])
    for part, column, table in LOOKED_UP:
        own = getattr(visits, part)
        row = getattr(own, column)[v]
        found = getattr(own, table)[row] if row >= 0 else None
        told.append(found.tolist() if isinstance(found, np.ndarray) else found)
    for column in ("literal", "follows"):
        row, all_ = visits.columns[column][v], visits.literals
        places = all_.places[row : row + 1]
        told.append(row >= 0 and [
            visits.files[all_.file[row]], int(all_.line[row]), places.start.tolist(),
            places.end.tolist(), bool(all_.joints[row]), all_.name[row],
            bool(all_.shared[row]), bool(all_.taught[row]), all_.pinned[row],
        ])  # fmt: skip
    pred = visits.graph.predecessors(v)
    return [*told, np.where(pred >= 0, pred - first, pred).tolist()]


def test_every_visit_says_the_same(programs):
    together = concatenate(programs)
    assert len(together) == sum(map(len, programs))
    for own, first in zip(programs, first_visits(programs), strict=True):
        for v in range(len(own)):
            alone, among = told(own, v, 0), told(together, first + v, first)
            np.testing.assert_equal(among, alone)


def test_literals_follow_each_other(programs):
    together = concatenate(programs)
    assert len(together.literals) == sum(len(own.literals) for own in programs)
    used = together.target.literal[together.target.literal >= 0]
    assert used.max() < len(together.literals)


def test_names_stay_texts(job_cell):
    job = spot(4)
    files = {job.name: job.source, "spot.lsv": job.variables}
    own = read_program(files, job_cell).visits
    together = concatenate([own, own])
    for names in (together.target.names, together.literals.name):
        assert isinstance(names, tuple) and {type(name) for name in names} == {str}
    assert together.literals.name == (*own.literals.name, *own.literals.name)


def test_one_program_stays_as_it_is(programs):
    (own,) = programs[:1]
    assert first_visits([own]) == (0,)
    np.testing.assert_equal(told(concatenate([own]), 0, 0), told(own, 0, 0))


def test_each_program_has_as_many_auxiliary_axes_as_it_uses(job_cell):
    head, tail = b"PROGRAM a\nVAR p : XTNDPOS\nBEGIN\n", b"END a\n"
    moves = [b"MOVE TO {1, 2, 3, 4, 5, 6}\n", b"MOVE TO {1, 2, 3, 4, 5, 6, 7, 8}\n"]
    own = [
        read_program({"a.pdl": head + move + tail}, job_cell).visits for move in moves
    ]
    together = concatenate(own)
    assert [v.target.aux.shape[1] for v in own] == [0, 2]
    np.testing.assert_array_equal(together.target.aux, [[np.nan, np.nan], [7.0, 8.0]])
