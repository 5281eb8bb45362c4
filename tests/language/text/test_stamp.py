"""The stamp says what made a program and comes off again."""

import pytest

from postproc.language.text.source import Source, source_from_bytes
from postproc.language.text.stamp import (
    Stamp,
    is_stamped,
    read_stamp,
    source_hash,
    stamp_line,
    stamp_place,
    strip_stamp,
)


def stamped(version: str, model: str, source: Source, data: bytes) -> bytes:
    at = stamp_place(data)
    return data[:at] + stamp_line(version, model, source, "--") + data[at:]


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


HEADER = b"%%%\r\n  VERSION:1\r\n  LANGUAGE:ENGLISH\r\n%%%"
MODULE = b"MODULE a\r\nENDMODULE\r\n"


@pytest.mark.parametrize("before", [b"", b"\xef\xbb\xbf", b"\r\n! made by hand\r\n"])
@pytest.mark.parametrize("behind", [b"\r\n", b" \t\r\n", b"", b"  "])
def test_a_stamp_goes_behind_the_header_of_a_module(before, behind) -> None:
    source = source_from_bytes("a.mod", before + HEADER + behind + MODULE)
    out = stamped("1.0", "abc", source, source.data)
    assert out.startswith(before + HEADER)
    assert len(out.splitlines()) == len(source.data.splitlines()) + 1
    assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
    assert is_stamped(source_from_bytes("a.mod", out))
    assert strip_stamp(out) == source.data


def test_a_stamp_in_front_of_a_header_is_known() -> None:
    source = source_from_bytes("a.mod", HEADER + b"\r\n" + MODULE)
    out = stamp_line("1.0", "abc", source, "!") + source.data
    assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
    assert strip_stamp(out) == source.data


@pytest.mark.parametrize("head", [
    b"MODULE a\r\n", b"module a (SYSMODULE,NOVIEW)  ! mine\r\n",
    b"! by hand\nMODULE a\n", b"\xef\xbb\xbfMODULE a\r\n",
    HEADER + b"\r\n  MODULE a\r\n",
])  # fmt: skip
def test_a_stamp_goes_into_the_module(head) -> None:
    source = source_from_bytes("a.mod", head + b"  VAR num n;\r\nENDMODULE\r\n")
    out = stamped("1.0", "abc", source, source.data)
    assert out.startswith(head + b"-- postproc 1.0")
    assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
    assert strip_stamp(out) == source.data


def test_a_head_on_several_lines_is_not_torn() -> None:
    source = source_from_bytes("a.mod", b"MODULE a(\nSYSMODULE)\nENDMODULE\n")
    out = stamped("1.0", "abc", source, source.data)
    assert out.startswith(b"-- postproc") and strip_stamp(out) == source.data


def test_a_byte_order_mark_stays_first() -> None:
    source = source_from_bytes("a.pdl", b"\xef\xbb\xbfPROGRAM a\nBEGIN\nEND a\n")
    out = stamped("1.0", "abc", source, source.data)
    assert out.startswith(b"\xef\xbb\xbf-- postproc")
    assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
    assert strip_stamp(out) == source.data
    before = stamp_line("1.0", "abc", source, "--") + source.data
    assert read_stamp(before) == Stamp("1.0", "abc", source_hash(source))
    assert strip_stamp(before) == source.data


@pytest.mark.parametrize("place", [0, len(HEADER) + 2])
def test_a_stamp_where_it_used_to_stand_is_known(place) -> None:
    source = source_from_bytes("a.mod", HEADER + b"\r\n" + MODULE)
    line = stamp_line("1.0", "abc", source, "!")
    out = source.data[:place] + line + source.data[place:]
    assert read_stamp(out) == Stamp("1.0", "abc", source_hash(source))
    assert strip_stamp(out) == source.data and is_stamped(source_from_bytes("a", out))
