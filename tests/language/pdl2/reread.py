"""The instructions of a rewritten program: the same, with the numbers of its text.

Clones are new lines. What is new in the text is read by a few patterns, which share
nothing with the parser that is tested.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tests.language.pdl2.executed import PAGE, Generated

CLONE = re.compile(r"\b\w+__\d+\b")
_NEW = re.compile(r"\s*(\w+__\d+)\s*(:=?)")
_SIX = re.compile(r"(?:POS\(|\{)([^'{}()]*?)(?:,\s*''\)|\})")
_NUMBER = re.compile(r"-?\d+\.\d+")
_LAST = re.compile(r"(-?\d+\.\d+)[^\d]*$")
_NAMED = {"move_to": (r"\bTO\s+(\w+)",), "arc": (r"\bTO\s+(\w+)", r"\bVIA\s+(\w+)")}
Op = tuple[Any, ...]
Lines = dict[int, int]


def reread(made: Generated, outputs: Mapping[str, bytes]) -> tuple[Generated, Lines]:
    """Take rewritten texts into a program; files without a new text stay as they are.

    Returns:
        The program, and the original line of each of its lines but for new ones.

    Raises:
        AssertionError: Something else than clones is new.
    """
    at: Lines = {}
    texts: dict[int, list[str]] = {}
    extra: set[int] = set()
    for number, (name, data) in enumerate(made.files.items()):
        old = data.decode("latin-1").splitlines()
        new = outputs.get(name, data).decode("latin-1").splitlines()
        new = new[1:] if new[0].startswith("-- postproc") else new
        kept = [k for k, line in enumerate(new) if not _NEW.match(line)]
        assert [_masked(new[k]) for k in kept] == [_masked(line) for line in old], name
        base = number * PAGE
        at |= {base + line + 1: base + k + 1 for line, k in enumerate(kept)}
        extra |= {base + k + 1 for k in range(len(new))} - {base + k + 1 for k in kept}
        texts[number] = new
    ops = {at[line]: moved(op, at) for line, op in made.ops.items()}
    for line in (*ops, *sorted(extra)):
        code = texts[line // PAGE][line % PAGE - 1].split("--")[0]
        ops[line] = _read(ops.get(line, ("nop",)), code)
    pages = tuple("\n".join(texts[k]) for k in range(1, len(texts)))
    after = replace(
        made, text="\n".join(texts[0]), ops=ops, entry=at[made.entry], pages=pages,
        routines={name: at[line] for name, line in made.routines.items()},
        handlers={number: at[line] for number, line in made.handlers.items()},
        extra=frozenset(extra),
    )  # fmt: skip
    return after, {new: line for line, new in at.items()}


def moved(op: Op, at: Lines) -> Op:
    """Give an instruction the lines of the new text."""
    match op:
        case ("jump" | "cycle", line):
            return op[0], at[line]
        case ("unless", test, line):
            return "unless", test, at[line]
        case ("select", name, cases, otherwise):
            new = [(values, at[line]) for values, line in cases]
            return "select", name, new, at[otherwise]
        case ("next", start, name, by):
            return "next", at[start], name, by
        case ("for", *rest, end):
            return "for", *rest, at[end]
        case ("evaluate", name, argument, ("unless", value, line)):
            return "evaluate", name, argument, ("unless", value, at[line])
    return op


def _read(op: Op, code: str) -> Op:
    """Take numbers and names of clones out of a line."""
    six = _SIX.search(code)
    numbers = _numbers(six[1]) if six else ()
    if op[0] == "nop" and (new := _NEW.match(code)) and new[2] == ":=":
        assert len(numbers) == 6, code
        return "set", new[1].lower(), numbers
    if op[0] in ("move", "set", "fill") and len(numbers) == 6:
        return (*op[:-1], numbers)
    if op[0] == "component" and (last := _LAST.search(code)):
        return (*op[:3], float(last[1]), op[4])
    if op[0] in _NAMED and CLONE.search(code):
        found = [re.search(pattern, code) for pattern in _NAMED[op[0]]]
        return (op[0], *(one[1].lower() for one in found if one))
    return op


def _masked(line: str) -> str:
    """Return a line without its numbers, and with the names of originals."""
    return _NUMBER.sub("#", re.sub(r"__\d+\b", "", line))


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
