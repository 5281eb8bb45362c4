"""A text read again with other numbers is read as it would be by itself."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.language.text.lexer import scan_lines
from postproc.language.text.logical_lines import read_lines, reread_lines
from postproc.language.text.source import Source
from tests.language.test_masking import TEXT

NUMBERS = st.lists(st.sampled_from(["7", "-0.25", "12.5e3", "1.0"]), min_size=1)
STAMP = b"-- postproc 1 'x 2.5\r\n"


def edited(data: bytes, new: list[str]) -> bytes:
    """Write other numbers into a text, as far as it reads as numbers alone then."""
    found = scan_lines(data, Source("x", data).line_starts)
    out, done = b"", 0
    places = zip(found.numbers.start, found.numbers.end, strict=True)
    for k, (a, b) in enumerate(places):
        out, done = out + data[done:a] + new[k % len(new)].encode(), int(b)
    return out + data[done:]


def said(source: Source) -> list[tuple[bytes, list[str]]]:
    """Return what lines say, but for what their numbers are worth."""
    found = scan_lines(source.data, source.line_starts)
    names = [found.names[k] for k in found.name.tolist()]
    ends = zip(found.name_first[:-1], found.name_first[1:], strict=True)
    masks = (found.masks[k] for k in found.shape)
    return [(mask, names[a:b]) for mask, (a, b) in zip(masks, ends, strict=True)]


@settings(max_examples=300, deadline=None)
@given(TEXT, NUMBERS, st.booleans())
def test_other_numbers_are_read_as_by_themselves(
    parts: list[str], new: list[str], stamped: bool
) -> None:
    before = Source("x", "".join(parts).encode("latin-1"))
    data = edited(before.data, new)
    after = Source("x", STAMP + data if stamped else data)
    try:
        old, alone = read_lines(before), read_lines(after)
    except ProgramError:
        return
    found = reread_lines(after, old)
    if found is None:  # only where another number makes another line of it
        assert said(after)[stamped:] != said(before)
        return
    lines, changed, added = found
    assert added == (0 if stamped else -1)
    for name in ("shape", "begin_line", "first"):
        assert np.array_equal(getattr(lines, name), getattr(alone, name)), name
    for name in ("start", "end"):
        now, meant = getattr(lines.numbers, name), getattr(alone.numbers, name)
        assert np.array_equal(now, meant), name
    assert np.array_equal(lines.value, alone.value, equal_nan=True)
    assert lines.shapes == alone.shapes
    texts = [
        [s.data[a:b] for a, b in zip(own.start, own.end, strict=True)]
        for s, own in ((before, old.numbers), (after, lines.numbers))
    ]
    assert changed.tolist() == [a != b for a, b in zip(*texts, strict=True)]


def rescanned(before: bytes, after: bytes) -> bool:
    """Tell whether a text is taken for another with other numbers."""
    starts = [Source("x", data).line_starts for data in (before, after)]
    count = len(scan_lines(before, starts[0]).numbers)
    found = _native.rescan_lines(before, starts[0], after, starts[1], count)
    return found is not None


def test_anything_else_is_not_taken_for_the_same() -> None:
    text = b"MOVE TO p1 -- a 1\r\nx := 5\r\n"
    assert rescanned(text, b"MOVE TO p1 -- a 1\r\nx := -7.5\r\n")
    assert rescanned(text, b"MOVE TO p1 -- a 1\r\n  -- new\r\nx := 5\r\n")
    assert not rescanned(text, b"MOVE TO p2 -- a 1\r\nx := 5\r\n")
    assert not rescanned(text, b"MOVE TO p1 -- a 2\r\nx := 5\r\n")
    assert not rescanned(text, b"MOVE TO p1 -- a 1\r\nx := 5, 5\r\n")
    assert not rescanned(text, b"MOVE TO p1 -- a 1\r\ny := 5\r\nx := 5\r\n")
    assert not rescanned(text, b"MOVE TO p1 -- a 1\r\n")
    assert not rescanned(text, b"MOVE TO p1 -- a 1\r\nx := '5\r\n")


def test_long_texts_are_read_in_parts() -> None:
    text = b"MOVE TO {1, 2, 3, 4, 5, 6}\n" * 10_000
    new = text.replace(b"3", b"-3.25")
    before, after = Source("x", text), Source("x", STAMP + new)
    found, alone = reread_lines(after, read_lines(before)), read_lines(after)
    assert found is not None
    lines, changed, _ = found
    assert np.array_equal(lines.value, alone.value)
    assert np.array_equal(lines.numbers.start, alone.numbers.start)
    assert changed.reshape(-1, 6).sum(axis=0).tolist() == [0, 0, 10_000, 0, 0, 0]
