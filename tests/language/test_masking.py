"""Whole files are scanned as the definition masks them, line by line."""

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from postproc.exceptions import ProgramError
from postproc.language.text.lexer import scan_lines
from postproc.language.text.source import Source, source_from_bytes
from postproc.language.text.statement_table import read_lines
from tests.reference.text import form_of, mask_line, masks_of, number_value

PIECES = (
    "1 0 9 . - , ( ) [ ] { } : = * ' \" \\ x e E $ -- .. TO 5.25 -0.5 0x3F 1..n "
    "1234567890.123456789"
).split()
TEXT = st.lists(
    st.sampled_from(
        [
            *PIECES,
            " ",
            " " * 7,
            " " * 70,
            "\t",
            "\n",
            "\r\n",
            "\r",
            "\x1a",
            "\xe9",
            "p1",
            "$q2",
            "l3 ::",
            "\xb2",
            "\x01",
            "0o17",
            "0b1",
            "1.e5",
            "x0x1",
        ]
    ),
    min_size=1,
    max_size=40,
)


@settings(max_examples=400, deadline=None)
@given(TEXT)
@example(["'", "\\", "'"])
@example(["{", " " * 7, "-", "1"])
@example(["{", " " * 70, "-", " " * 70, "1"])
def test_files_are_scanned_as_lines_are_masked(parts: list[str]) -> None:
    data = "".join(parts).encode("latin-1")
    starts = Source("x", data).line_starts
    masked = scan_lines(data, starts)
    lines = re.split(rb"\r\n|\n|\r", data)
    if not lines[-1] and len(lines) > 1:
        lines.pop()
    for row, line in enumerate(lines):
        wanted = mask_line(line.decode("latin-1"))
        at = int(starts[row])
        mine = slice(masked.first[row], masked.first[row + 1])
        form, names = form_of(wanted.mask)
        assert masked.masks[masked.shape[row]].decode("latin-1") == form
        own = masked.name[masked.name_first[row] : masked.name_first[row + 1]]
        assert tuple(masked.names[k] for k in own) == names
        assert (masked.numbers.start[mine] - at).tolist() == list(wanted.start)
        assert (masked.numbers.end[mine] - at).tolist() == list(wanted.end)
        assert masked.comment[row] == (
            at + wanted.comment if wanted.comment >= 0 else -1
        )
        assert (row in masked.unterminated) == wanted.unterminated
    places = zip(masked.numbers.start, masked.numbers.end, strict=True)
    texts = [data[a:b].decode("latin-1") for a, b in places]
    assert np.array_equal(
        masked.value, [number_value(t) for t in texts], equal_nan=True
    )


@given(st.floats(-1e6, 1e6), st.integers(0, 9))
def test_values_are_read_as_python_reads_them(value: float, decimals: int) -> None:
    text = f"{value:.{decimals}f}"
    data = f"p := {text}\n".encode()
    assert scan_lines(data, np.zeros(1, np.int32)).value.tolist() == [float(text)]


@pytest.mark.parametrize(
    ("line", "numbers"),
    [
        ("x := -1.5 - 2 -3", ["-1.5", "2", "3"]),
        ("POS(- 2, a-1, .5, 1e-3)", ["- 2", "1", ".5", "1e-3"]),
        ("a1.x := $FMI[2] + 0x3F", ["2", "0x3F"]),
        ("ALONG p[1..n]", ["1"]),
        ("WRITE ('1 2 -- 3', x::4) -- 5", ["4"]),
        ("s := 'it''s 1' + 2", ["2"]),
        (r"OPEN FILE l ('UD:\', '3')", []),
        ('s := "it\'s 1" -- 2', []),
    ],
)
def test_what_a_number_is(line: str, numbers: list[str]) -> None:
    masked = mask_line(line)
    spans = zip(masked.start, masked.end, strict=True)
    assert [line[a:b] for a, b in spans] == numbers


@pytest.mark.parametrize(
    "text",
    ["0x" + "F" * 40, "-0b" + "10" * 90, "0o" + "7" * 70, "9" * 400, "1e400", "1e-400",
     "0.1000000000000000055511151231257827", "123456789012345678", "00012.50", "1.e5"],
)  # fmt: skip
def test_long_numbers_are_read_as_python_reads_them(text: str) -> None:
    (value,) = scan_lines(f"x({text})".encode(), np.zeros(1, np.int32)).value.tolist()
    assert value == number_value(text)


def test_lines_that_are_not_there_are_refused() -> None:
    for starts in ([0, 9], [3, 1], [-1]):
        with pytest.raises(IndexError):
            scan_lines(b"abc", np.array(starts, np.int32))


def test_a_long_file_is_one_file() -> None:
    line = b"  MOVE LINEAR TO POS(1.5, -2.25, 3, 4, 5, 6, '') -- 7\r\n"
    count = 3 * (1 << 20) // len(line)
    lines = read_lines(source_from_bytes("x", line * count))
    assert len(lines) == count
    assert len(lines.shapes) == 1
    assert np.array_equal(np.diff(lines.first), np.full(count, 6))
    assert lines.value[-5] == -2.25
    start, end = lines.numbers.start, lines.numbers.end
    assert lines.source.data[start[-5] : end[-5]] == b"-2.25"


def test_statements_are_joined_up_to_endmove() -> None:
    text = (
        b"MOVE TO p ,\r\n -- note\r\n\r\n WITH CONDITION[3],\r\n WITH $LIN_SPD=0.5\r\n"
        b" ENDMOVE\r\nMOVE TO q,\nMOVE TO r"
    )
    lines = read_lines(source_from_bytes("x", text))
    assert lines.begin_line.tolist() == [1, 7, 8]
    assert lines.value.tolist() == [3.0, 0.5]
    assert masks_of(lines.shapes)[int(lines.shape[0])].endswith("ENDMOVE")


def test_an_open_string_is_refused_with_its_line() -> None:
    with pytest.raises(ProgramError, match=r"x:2: a string is not terminated"):
        read_lines(source_from_bytes("x", b"BEGIN\n  WRITE ('hello, NL)\nEND"))


def test_many_names_are_told_apart() -> None:
    names = [f"p{k}" for k in range(3000)] + [f"weld_{k}_x" for k in range(3000)]
    order = [k * 7919 % len(names) for k in range(2 * len(names))]
    data = "".join(f"MOVE TO {names[k]}\n" for k in order).encode()
    found = scan_lines(data, Source("x", data).line_starts)
    assert [found.names[k] for k in found.name] == [names[k] for k in order]
    assert len(found.names) == len(set(found.names)) == len(names)
    assert len(found.masks) == 1
