"""Names as the core keeps them are those that a tuple of texts would hold."""

from __future__ import annotations

import copy
import pickle
import signal
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.language.text.symbol_column import NameColumn

LETTERS = "aAbB_1[.\xe4\xc4\xb5\xff"  # of Latin-1, as programs are
TEXTS = st.lists(st.text(LETTERS, max_size=4), max_size=40)


@given(TEXTS, TEXTS)
def test_names_are_found_by_first_number(own: list[str], asked: list[str]) -> None:
    names = NameColumn(own)
    meant = [own.index(one) if one in own else -1 for one in asked]
    assert names.find(asked).tolist() == meant
    assert names.find(NameColumn(asked)).tolist() == meant
    assert [names.number(one) for one in asked] == meant
    assert [one in names for one in asked] == [k >= 0 for k in meant]


@given(TEXTS, TEXTS)
def test_names_are_numbered_as_they_come(first: list[str], then: list[str]) -> None:
    names, meant = NameColumn(), {}
    for some in (first, then):
        numbers = [meant.setdefault(one, len(meant)) for one in some]
        assert names.of(some).tolist() == numbers
    assert names == tuple(meant) and [*names] == [*meant] and len(names) == len(meant)


@given(TEXTS)
def test_a_column_is_a_sequence(own: list[str]) -> None:
    names = NameColumn(own)
    assert isinstance(names, Sequence)
    names.extend(own)
    assert [*names] == own + own and names == NameColumn(own + own)
    assert [*names.lower()] == [one.lower() for one in names]
    numbers = np.arange(len(names), dtype=np.int64)[::-3].copy()
    assert [*names.take(numbers)] == [names[k] for k in numbers.tolist()]
    assert names.hold("[.") == any(mark in "".join(own) for mark in "[.")
    for same in (pickle.loads(pickle.dumps(names)), copy.deepcopy(names)):
        assert same == names
    assert repr(names) == f"NameColumn({own + own!r})"
    names.settle()
    assert [*names] == own + own and names.find(own).tolist() == [*map(own.index, own)]


def test_what_is_no_name_is_refused() -> None:
    names = NameColumn(["a", "b"])
    assert names != ("a",) and names != "ab" and 1 not in names
    with pytest.raises(IndexError):
        names[2]
    for wrong in (-1, 2):
        with pytest.raises(IndexError):
            names.take(np.array([wrong]))
    with pytest.raises(TypeError):
        names.extend([1])


def test_an_interruption_leaves_no_table_of_some_names() -> None:
    names = NameColumn([f"p{k}" for k in range(300_000)])

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, 2e-3)
            names.find(["p299999"])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert names.find(["p299999", "p0", "q"]).tolist() == [299_999, 0, -1]
