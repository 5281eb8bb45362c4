"""The stamp says what made a program and comes off again."""

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
