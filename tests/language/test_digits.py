"""Numbers written and read by arrays are those that Python writes and reads."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from postproc.language.rewrite import (
    _texts,
    cut,
    decimals,
    decimals_of,
    fixed,
    number_text,
)
from postproc.language.source import Edit, Replacements, Span, apply

VALUES = st.floats(-1e9, 1e9) | st.integers(-10_000, 10_000).map(lambda k: k / 2000)


@given(st.lists(st.tuples(VALUES, st.integers(0, 9), st.integers(3, 5)), max_size=30))
def test_numbers_are_written_as_python_writes_them(rows):
    values, had, least = (
        (np.array(column) for column in zip(*rows, strict=True))
        if (rows)
        else (np.empty(0), np.empty(0, int), np.empty(0, int))
    )
    wanted = [number_text(v, d, few) for v, d, few in rows]
    assert [t.decode() for t in _texts(values, had, least)] == wanted


def test_only_values_next_to_halfway_are_not_sure():
    values = np.random.default_rng(1).uniform(-3000, 3000, 20_000)
    _, sure = fixed(values, np.full(len(values), 4))
    assert sure.mean() > 0.999
    _, sure = fixed(np.array([0.00005, 1e18, np.nan]), np.array([4, 4, 4]))
    assert not sure.any()


def test_numbers_are_cut_and_read():
    words = ["1.5", "-12.", ".25", "7", "-0.0000", "- 3", "1e5", "0x1F", "1..2", "-"]
    data = " ".join(words).encode()
    ends = np.cumsum([len(w) + 1 for w in words]) - 1
    texts, plain = cut(data, ends - [len(w) for w in words], ends)
    assert plain.tolist() == [True] * 5 + [False] * 5
    assert [t.decode() for t in texts] == words
    assert decimals(texts[plain]).tolist() == [decimals_of(w) for w in words[:5]]


@given(st.data())
def test_a_million_edits_are_applied_as_one(data):
    text = data.draw(st.binary(min_size=1, max_size=40)).replace(b"\0", b" ")
    places = data.draw(st.lists(st.integers(0, len(text)), max_size=12).map(sorted))
    spans = zip(places[0::2], places[1::2], strict=False)
    new = st.text("0123456789", min_size=1, max_size=5).map(str.encode)
    edits = [Edit(Span(a, b), data.draw(new)) for a, b in spans]
    many = Replacements.of(edits)
    out = apply(text, many)
    assert list(many) == sorted(edits, key=lambda edit: edit.span)
    assert out == apply(text, edits)
    assert apply(b"stamp" + out, many.undone(text, 5)) == b"stamp" + text
