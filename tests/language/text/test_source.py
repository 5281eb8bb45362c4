"""Bytes in, bytes out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc import _native
from postproc.exceptions import ProgramError
from postproc.language.text.source import (
    Edit,
    NumberSpans,
    Replacements,
    Source,
    Span,
    apply,
    compose,
    source_from_bytes,
)

TEXT = st.lists(st.sampled_from([b"a", b"\r", b"\n", b"\r\n", b"\xe9"]), max_size=30)


@given(TEXT)
def test_lines_partition_the_text(parts: list[bytes]) -> None:
    data = b"".join(parts)
    source = Source("x", data)
    starts = source.line_starts
    wanted = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
    if len(wanted) > 1 and not wanted[-1]:
        wanted.pop()
    assert len(starts) == len(wanted)
    for line, text in enumerate(wanted, start=1):
        assert source.line_text(line) == text.decode("latin-1")
        assert source.line_of(int(starts[line - 1])) == line


@given(st.binary(max_size=60), st.data())
def test_edits_change_their_spans_only(data: bytes, draw: st.DataObject) -> None:
    places = draw.draw(st.lists(st.integers(0, len(data)), max_size=8))
    places = sorted(places)[: len(places) // 2 * 2]
    edits = [
        Edit(Span(a, b), draw.draw(st.binary(max_size=5)))
        for a, b in zip(places[0::2], places[1::2], strict=True)
    ]
    out = apply(data, edits)
    assert len(out) == len(data) + sum(
        len(e.new) - (e.span.end - e.span.start) for e in edits
    )
    back, shift = [], 0
    for (start, end), new in edits:
        back.append(
            Edit(Span(start + shift, start + shift + len(new)), data[start:end])
        )
        shift += len(new) - (end - start)
    assert apply(out, back) == data


def test_overlapping_edits_are_refused() -> None:
    with pytest.raises(ValueError, match="overlaps"):
        apply(b"abcdef", [Edit(Span(0, 3), b""), Edit(Span(2, 4), b"")])


@pytest.mark.parametrize("data", [b"", b" \r\n", b"\xef\xbb\xbf"])
def test_empty_files_are_refused(data: bytes) -> None:
    with pytest.raises(ProgramError, match="empty"):
        source_from_bytes("x.pdl", data)


def test_a_text_whose_places_cannot_be_told_is_refused(monkeypatch) -> None:
    monkeypatch.setattr("postproc.language.text.source.LAST", 99)
    assert source_from_bytes("x.pdl", b"a" * 99).data
    with pytest.raises(
        ProgramError, match=r"x\.pdl: has 100 bytes; at most 99 .*\. Divide"
    ):
        source_from_bytes("x.pdl", b"a" * 100)


def test_binary_files_are_refused_with_the_line() -> None:
    with pytest.raises(ProgramError, match=r"x\.cod:2: .*binary.*text of the program"):
        source_from_bytes("x.cod", b"PROGRAM x\r\n\x00\x01")


def test_newline_is_that_of_the_first_line() -> None:
    assert Source("x", b"a\nb\r\n").newline == b"\n"
    assert Source("x", b"a\r\nb\n").newline == b"\r\n"
    assert Source("x", b"a").newline == b"\r\n"
    assert np.array_equal(Source("x", b"a").line_starts, [0])


@given(st.binary(max_size=20), st.data())
def test_two_rounds_of_edits_make_one(data: bytes, draw: st.DataObject) -> None:
    def edits(size: int, borders: list[int]) -> list[Edit]:
        points = draw.draw(st.lists(st.integers(0, size), max_size=8))
        points = sorted(points)[: len(points) // 2 * 2]
        pairs = zip(points[0::2], points[1::2], strict=True)
        new = st.binary(max_size=4)
        return [
            Edit(Span(a, b), draw.draw(new))
            for a, b in pairs
            if a < b and not any(a < border < b for border in borders)
        ]

    first = edits(len(data), [])
    borders, shift = [], 0
    for (start, end), new in first:
        borders += [start + shift, start + shift + len(new)]
        shift += len(new) - (end - start)
    middle = apply(data, first)
    second = edits(len(middle), borders)
    assert apply(data, compose(first, second)) == apply(middle, second)


def test_an_edit_over_the_border_of_another_is_refused() -> None:
    with pytest.raises(ValueError, match="border"):
        compose([Edit(Span(2, 2), b"xy")], [Edit(Span(1, 3), b"")])


def test_edits_from_several_places_are_merged_in_order() -> None:
    def edits(*starts: int) -> Replacements:
        return Replacements.of(Edit(Span(s, s + 1), b"%d" % s) for s in starts)

    nothing = edits()
    for parts in (
        [edits(0, 2), edits(4)],
        [edits(4), edits(0, 2)],
        [edits(2, 4), nothing, edits(0)],
    ):
        assert list(Replacements.merge(parts)) == list(edits(0, 2, 4))
    with pytest.raises(ValueError, match="overlap"):
        Replacements.merge([edits(4), edits(4)])


@given(
    st.binary(max_size=40).map(lambda data: data.replace(b"\0", b"x")),
    st.lists(st.tuples(st.integers(0, 40), st.sampled_from([b"", b"7", b"+12.5"]))),
)
def test_many_edits_do_what_single_edits_do(data, wanted) -> None:
    places = sorted(min(place, len(data)) for place, _ in wanted)
    new = [text for _, text in wanted]
    spans = map(Span, places[0::2], places[1::2])
    found = list(map(Edit, spans, new))
    many, result = Replacements.of(found), apply(data, found)
    assert apply(data, many) == result
    assert many.reproduces(data, result)
    for at in {0, len(result) // 2, len(result)}:
        stamped = result[:at] + b"stamp" + result[at:]
        assert many.reproduces(data, stamped, (at, at + 5))
        assert not many.reproduces(data, stamped, (at, at + 4))
        assert not many.reproduces(data, result, (at, len(result) + 1))
    for other in (result + b"x", b"x" + result, result[:-1], b""):
        assert other == result or not many.reproduces(data, other)


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(1, 70_000), st.integers(1, 300)), max_size=60))
def test_places_of_numbers_are_those_where_they_stand(gaps):
    ends = np.cumsum(np.array(gaps, dtype=np.int64).reshape(-1, 2).ravel())
    start, end = ends[::2], ends[1::2]
    text = b"".join(gap * b" " + length * b"7" for gap, length in gaps)
    numbers = NumberSpans(*_native.scan_krl(text)[2][0])
    assert len(numbers) == len(gaps)
    assert numbers.start.tolist() == start.tolist()
    assert numbers.end.tolist() == end.tolist()
    some = np.arange(len(gaps))[::-2]
    assert numbers.starts(some).tolist() == start[some].tolist()
    assert numbers.ends(some).tolist() == end[some].tolist()
    rows = slice(len(gaps) // 3, len(gaps) // 2)
    assert numbers.starts(rows).tolist() == start[rows].tolist()
    assert numbers.ends(rows).tolist() == end[rows].tolist()
    for column in (numbers.offset, numbers.length):
        assert column.dtype == np.min_scalar_type(int(column.max(initial=0)))
