"""Numbers are written and rewritten as Python writes and reads them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc import _native
from postproc.language.text.source import Edit, Replacements, Span, apply
from tests.language.digits import number_texts
from tests.reference.text import decimals_of, number_value

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
    assert number_texts(values, decimals) == [number_text(v, d) for v, d in rows]


@given(
    st.lists(st.sampled_from(WORDS) | VALUES.map("{:.3f}".format), max_size=20),
    st.sampled_from([0.7, 1e-4, 0.0]),
    st.integers(0, 4),
)
def test_numbers_are_rewritten_with_their_decimals(words, step, least):
    data = f"({', '.join(words)})".encode()
    start = 1 + np.cumsum([0, *(len(w) + 2 for w in words)])[:-1]
    end = start + np.array([len(w) for w in words], dtype=np.int64)
    old = np.array([number_value(w) for w in words], dtype=float)
    new, atleast = old + step, np.full(len(old), least)
    rows, texts = _native.rewrite_numbers(data, start, end, new, atleast)
    found = {int(row): bytes(text).rstrip(b"\0") for row, text in zip(rows, texts)}  # noqa: B905
    for k, word in enumerate(words):
        decimals = max(decimals_of(word), least)
        text = number_text(new[k], decimals)
        if abs(new[k] - old[k]) <= 0.5 * 10.0**-decimals or float(text) == old[k]:
            assert k not in found
        else:
            plus = "+" * (word[0] == "+" and text[0] != "-")
            assert found[k].decode() == plus + text


def test_numbers_outside_of_a_text_are_refused():
    one, least = np.array([0]), np.array([3])
    for start, end in ((5, 9), (-1, 2), (3, 2)):
        with pytest.raises(IndexError):
            _native.rewrite_numbers(b"1.5", one + start, one + end, one + 0.5, least)


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
    assert apply(b"stamp" + out, many.invert(text, 5)) == b"stamp" + text
