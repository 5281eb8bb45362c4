"""What came of the targets on a line, written into a record and read back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.outcome import Status
from postproc.compensation.output.line_outcomes import BOTH, LineOutcomes, tell_arrivals
from tests.report.html.builders import FIRST_LINE, decisions_of, visits_of


def test_every_line_comes_back():
    visits = visits_of(60, "job.pdl", ("",))
    decisions = decisions_of(visits, 1)
    (told,) = tell_arrivals(visits, decisions, ("job.pdl",)).values()
    found = LineOutcomes.read(told)
    assert found.line.tolist() == list(range(FIRST_LINE, FIRST_LINE + 60))
    assert found.status.tolist() == decisions.status.tolist()
    assert np.array_equal(found.direction, decisions.direction)
    size = np.linalg.norm(decisions.correction, axis=1) * 1e3
    assert found.correction_mm == pytest.approx(size, abs=1e-4)
    assert [found.reasons[k].text for k in found.why] == [
        decisions.reasons[k].text for k in decisions.why
    ]
    assert sum(found.counts.values()) == 60


def test_visits_of_one_line_are_told_together():
    told = {
        "line": [7, 3, 7],
        "status": "030",
        "direction": "+++++++-0+-0+--0-+",
        "correction_mm": [0.5, 0.0, 0.7],
        "why": [0, 1, 0],
        "reasons": ["", "too near"],
    }
    found = LineOutcomes.read(told)
    assert found.line.tolist() == [3, 7]
    assert found.status.tolist() == [Status.REJECTED, Status.CORRECTED]
    assert found.direction[1].tolist() == [1, BOTH, BOTH, BOTH, BOTH, 1]
    assert found.correction_mm.tolist() == [0.0, 0.7]
    assert found.find([7, 4, 3]).tolist() == [1, -1, 0]
    assert found.mixed == {}


def test_the_most_urgent_status_of_a_line_counts():
    told = {"line": [1] * 3, "correction_mm": [0] * 3, "direction": "0" * 18}
    for status, wanted in (("401", 1), ("403", 3), ("402", 2), ("440", 0)):
        found = LineOutcomes.read(told | {"status": status, "why": [0, 1, 2],
                                      "reasons": ["a", "b", "c"]})  # fmt: skip
        assert found.status.tolist() == [wanted]
        assert found.why.tolist() == [status.index(str(wanted))]
        assert sum(found.mixed[0].values()) == 3
    assert found.mixed == {0: {"corrected": 1, "unchanged": 2}}


def test_lines_whose_visits_have_several_statuses_are_counted():
    told = {
        "line": [7, 3, 7, 9, 7, 9],
        "status": "030304",
        "direction": "0" * 36,
        "correction_mm": [0.0] * 6,
        "why": [0] * 6,
        "reasons": [""],
    }
    found = LineOutcomes.read(told)
    assert found.line.tolist() == [3, 7, 9]
    assert found.mixed == {2: {"rejected": 1, "unchanged": 1}}


def test_numbers_in_a_file_that_is_not_written_belong_to_their_move():
    visits = visits_of(4, "job.pdl", ("p",))
    other = replace(visits.literals, file=visits.literals.file + 1)
    moved = replace(visits, files=("job.pdl", "job.lsv"), literals=other)
    decisions = decisions_of(moved, 1)
    own = tell_arrivals(moved, decisions, ("job.pdl",))["job.pdl"]
    assert own["line"].tolist() == [4, 5, 6, 7]
    both = tell_arrivals(moved, decisions, ("job.pdl", "job.lsv"))
    assert both["job.pdl"]["line"].tolist() == [] and len(both["job.lsv"]["line"]) == 4


def test_no_visits():
    visits = visits_of(0, "job.pdl", ("",))
    (told,) = tell_arrivals(visits, decisions_of(visits, 1), ("job.pdl",)).values()
    found = LineOutcomes.read(told)
    assert len(found.line) == 0 and found.find([1]).tolist() == [-1]
