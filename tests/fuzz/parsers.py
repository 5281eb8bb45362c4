"""What must hold of the two parsers for any bytes."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np

from postproc.exceptions import PostprocError
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.number_edits import difference
from postproc.language.text.source import Replacements, Source, apply, source_from_bytes
from postproc.language.text.statement_table import Statements, read_lines


def program(data: bytes) -> None:
    """Parse bytes as a program."""
    with contextlib.suppress(PostprocError):
        source = source_from_bytes("fuzz.pdl", data)
        check_numbers(parse(source).lines)


def variables(data: bytes) -> None:
    """Read bytes as a variable file."""
    with contextlib.suppress(PostprocError):
        source = source_from_bytes("fuzz.lsv", data)
        read = read_variables(source)
        assert (read.entries.slots < len(read.lines.numbers)).all()
        check_numbers(read_lines(source))


def check_numbers(lines: Statements[Any]) -> None:
    """Check that the numbers can be written anew, and nothing else changes by that.

    What stands behind a sign of its own (``+-5``) is computed, and never written.

    Raises:
        AssertionError: Numbers overlap, or bytes between them would change.
    """
    source, start, end = lines.source, lines.numbers.start, lines.numbers.end
    same = [source.data[a:b] for a, b in zip(start, end, strict=True)]
    assert apply(source.data, replaced(lines, same)) == source.data
    signed = [source.data[max(a - 1, 0) : a] in (b"+", b"-") for a in start.tolist()]
    new = [own if kept else b"7.5" for own, kept in zip(same, signed, strict=True)]
    other = replaced(lines, new)
    problem = difference(source, Source(source.name, apply(source.data, other)), other)
    assert not problem, problem


def replaced(lines: Statements[Any], texts: list[bytes]) -> Replacements:
    """Return the edits that give every number a text."""
    return Replacements(
        lines.numbers.start, lines.numbers.end, np.array(texts, dtype=np.bytes_)
    )
