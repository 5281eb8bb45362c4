"""The stamp says what made a program and comes off again."""

import pytest

from postproc.language.source import source_from_bytes
from postproc.language.stamp import (
    Stamp,
    is_stamped,
    read_stamp,
    source_hash,
    stamped,
    strip_stamp,
)


def test_stamp_round_trip_in_the_files_own_line_ending() -> None:
    for newline in (b"\r\n", b"\n"):
        source = source_from_bytes("a", b"PROGRAM a" + newline + b"BEGIN\nEND a")
        out = stamped("1.0", "abc", source, source.data)
        assert out.startswith(b"-- postproc 1.0 model=abc source=")
        assert out.split(b"source=")[1][64:].startswith(newline)
        assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
        assert strip_stamp(out) == source.data
        assert is_stamped(source_from_bytes("a", out))
        assert not is_stamped(source)


def test_a_stamp_that_has_moved_is_still_seen() -> None:
    source = source_from_bytes("a", b"PROGRAM a\n")
    out = b"-- header\n" + stamped("1.0", "abc", source, source.data)
    assert is_stamped(source_from_bytes("a", out))
    assert read_stamp(out) is None


@pytest.mark.parametrize(
    "change",
    [
        bytes.upper,
        lambda line: line.replace(b"-- ", b"--"),
        lambda line: line.replace(b" ", b"\t "),
        lambda line: line.replace(b"=", b" = "),
        lambda line: b"   " + line.title(),
        lambda line: b"\xef\xbb\xbf" + line,
    ],
)
def test_a_stamp_is_known_in_any_case_and_spacing(change) -> None:
    source = source_from_bytes("a", b"PROGRAM a\nBEGIN\nEND a\n")
    first, _, rest = stamped("1.0", "abc", source, source.data).partition(b"\n")
    out = change(first) + b"\n" + rest
    assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
    for moved in (out, b"-- header\r" + out, b"-- header\r\n" + out):
        assert is_stamped(source_from_bytes("a", moved))


@pytest.mark.parametrize(
    "line",
    [
        b"MOVE TO p  -- postproc 1.0 model=abc",
        b"-- made by postproc 1.0 model=abc",
        b"-- postproc is used in this cell",
    ],
)
def test_what_is_no_stamp(line) -> None:
    assert not is_stamped(source_from_bytes("a", b"PROGRAM a\n" + line + b"\nEND a"))
