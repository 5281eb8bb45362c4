"""Literals by the columns of visits: found without a search where numbers ascend."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from postproc import _native
from postproc.language.analysis import visit_columns
from postproc.language.analysis.visit_columns import (
    Numbering,
    VisitColumns,
    find_literals,
)
from postproc.language.text.source import Source
from postproc.language.text.statement_table import read_text

WIDTH = 4
TEXT = b" ".join(b"%d" % k for k in range(60)) + b"\n"
ROWS = st.lists(
    st.tuples(st.integers(0, 3), st.integers(0, WIDTH)), min_size=1, max_size=9
)


def columns_of(slots):
    """Return columns of visits with some numbers, and where these stand."""
    text = read_text(Source("a.src", TEXT), _native.scan_krl, str)
    numbering = Numbering([text])
    columns = VisitColumns(len(slots), WIDTH, 0, len(numbering))
    columns.slots[:] = slots
    return columns, numbering


@given(ROWS, st.permutations(range(WIDTH)), st.booleans())
def test_literals_are_the_same_without_a_search(rows, order, swapped):
    """Of targets whose last numbers are missing, or whose numbers are mixed up."""
    slots, at = np.full((len(rows), WIDTH), -1), 0
    for k, (gap, count) in enumerate(rows):
        slots[k, :count] = np.arange(at + gap, at + gap + count)
        at += gap + count
    slots = slots[:, order] if swapped else slots
    assume((slots[:, 0] >= 0).any())
    found = []
    for ascend in (visit_columns._ascend, lambda slots: False):
        columns, numbering = columns_of(slots)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(visit_columns, "_ascend", ascend)
            literals, literal = find_literals(columns, numbering)
        places = literals.places.start.tolist(), literals.places.end.tolist()
        found.append((literal.tolist(), literals.line.tolist(), places))
        assert not columns.reason.any()
    assert found[0] == found[1]
    written = slots[:, 0] >= 0
    assert (np.array(found[0][0]) >= 0).tolist() == written.tolist()


@pytest.mark.parametrize(
    "slots, ascends",
    [
        ([[0, 1, 2, 3], [4, 5, 6, 7]], True),
        ([[0, 1, 2, -1], [4, 5, -1, -1], [6, 7, 8, 9]], True),
        ([[0, 1, 2, 3], [3, 5, 6, 7]], False),
        ([[0, -1, 2, 3], [4, 5, 6, 7]], False),
        ([[1, 0, 2, 3], [4, 5, 6, 7]], False),
        ([[4, 5, 6, 7], [0, 1, 2, 3]], False),
    ],
)
def test_numbers_ascend_from_target_to_target(slots, ascends):
    assert visit_columns._ascend(np.array(slots)) == ascends
