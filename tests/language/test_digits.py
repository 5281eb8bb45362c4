"""Numbers written and read by arrays are those that Python writes and reads."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from postproc.language.rewrite import number_texts
from postproc.language.scan import decimals_of, number_value, read_numbers
from postproc.language.source import Edit, Replacements, Span, apply

VALUES = st.floats(-1e9, 1e9) | st.integers(-10_000, 10_000).map(lambda k: k / 2000)
WORDS = (
    "1.5", "-12.", ".25", "7", "-0.0000", "+3.25", "- 3", "1e5", "-1.25e-2", "0x1F",
    "0b101", "123456789.123456789", "-1234567.12345678",
)  # fmt: skip


def number_text(value: float, decimals: int) -> str:
    """Write a number; its sign stands before the digits, a zero carries none."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


@given(st.lists(st.tuples(VALUES, st.integers(0, 12)), max_size=30))
def test_numbers_are_written_as_python_writes_them(rows):
    values = np.array([value for value, _ in rows], dtype=float)
    decimals = np.array([d for _, d in rows], dtype=np.int64)
    found = [text.decode() for text in number_texts(values, decimals)]
    assert found == [number_text(v, d) for v, d in rows]


@given(st.lists(st.sampled_from(WORDS) | VALUES.map("{:.3f}".format), max_size=20))
def test_numbers_are_read_at_their_places(words):
    data = f"({', '.join(words)})".encode()
    start = 1 + np.cumsum([0, *(len(w) + 2 for w in words)])[:-1]
    end = start + np.array([len(w) for w in words], dtype=np.int64)
    values, decimals = read_numbers(data, start, end)
    assert values.tolist() == [number_value(w) for w in words]
    assert decimals.tolist() == [decimals_of(w) for w in words]


def test_a_part_of_something_is_read_by_itself():
    data = b"1..2 x5 4 .5"
    start, end = np.array([0, 3, 6, 8, 10]), np.array([1, 4, 7, 9, 12])
    values, decimals = read_numbers(data, start, end)
    assert values.tolist() == [1, 2, 5, 4, 0.5]
    assert decimals.tolist() == [0, 0, 0, 0, 1]


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
