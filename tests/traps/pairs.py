"""Traps, and the plain programs that spell out what the controller does in them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from postproc import Options, Outcome, PostprocError, compensate
from postproc.model.model import Model
from postproc.robot.cell import Cell

FOLDER = Path(__file__).parent
MACRO = re.compile(r"<([A-Z])(\.[a-z])?((?:[-+][\d.]+){3})?(?:#(\w+))?>")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
COMMENT = {"rapid": "!", "krl": ";", "pdl2": "--"}
FIRST = {"rapid": "job.mod", "krl": "job.src", "pdl2": "job.pdl"}
TARGET = {
    "rapid": r"\[\[[^\]\[]*\],\[[^\]]*\](?:,\[[^\]]*\],\[[^\]]*\])?\]",
    "krl": r"\{(?:X|A1) [^{}]*\}",
    "pdl2": r"POS\([^()]*\)|\{[^{}]*\}",
}
SHIFT = re.compile(r"(?:,[-\d.]+){3}(?=[\\)])")
LISTED = re.compile(r"^\w+_(\w) POS .*\n( X:.*)", re.MULTILINE)
DECLARED = re.compile(
    r"^\s*(?:.*\b(?:robtarget|E6POS)\s+)?(\w+)(?:\{\d\}|\[[\d,]*\])?\s*:?=",
    re.IGNORECASE,
)
OUTSIDE = "[9E9,9E9,9E9,9E9,9E9,9E9]"
UNCERTAIN = re.compile(r"(.*?):(\d+): direction-uncertain: .*\(\+-([\d.]+) mm\)")
SHARED = re.compile(r"(.*?):(\d+): arrivals-averaged: .* ([\d.]+) mm off each")
MAYBE = re.compile(r"(.*?):(\d+): fly-unknown: ()")
PASSED = "0.02"
"""How far a correction for a stop may be off where the point is passed [mm]."""
TOLERANCE = 0.002
"""Corrections that differ by less are the same [mm, deg]."""

Files = Mapping[str, str]
Changes = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Trap:
    """A program that a careless reader misunderstands.

    Attributes:
        title: With its number.
        files: Of the trap, by name.
        plain: What the controller does, spelled out; one for every execution.
        known: What the verdict may be besides right.
    """

    title: str
    files: Files
    plain: Sequence[Files]
    known: str = ""


@dataclass(frozen=True)
class Run:
    """What became of a program.

    Attributes:
        changes: Of the numbers of every tagged target; none if it is refused.
        exit_code: Of the command.
        doubts: Tags whose direction is uncertain, with the stated error [mm].
    """

    changes: Changes | None
    exit_code: int
    doubts: Mapping[str, float]


@dataclass(frozen=True)
class Verdict:
    """On a trap.

    Attributes:
        word: "right", "middle" (corrected for the middle of a play, and listed),
            "left" or "refused" without need, or "wrong".
        detail: What is wrong, and which targets are left.
    """

    word: str
    detail: str = ""


def read_traps(language: str) -> list[Trap]:
    """Read the traps of a language."""
    text = (FOLDER / f"{language}.txt").read_text()
    head, *blocks = re.split(r"^=== ", text, flags=re.MULTILINE)
    parts = dict(_sections(head))
    return [_trap(block, parts, language) for block in blocks]


def _trap(block: str, parts: Files, language: str) -> Trap:
    title, rest = block.split("\n", 1)
    programs: list[dict[str, str]] = []
    for name, body in _sections(rest):
        word, _, file = name.partition(" ")
        if word != "also":
            programs.append({n: text for n, text in parts.items() if n[-4:] == ".dat"})
        file = file or FIRST[language]
        programs[-1][file] = expanded(body, parts, language, file)
    title, _, known = title.partition(" | ")
    return Trap(title, programs[0], programs[1:], known)


def _sections(text: str) -> Iterator[tuple[str, str]]:
    found = re.split(r"^--- (.*)\n", text, flags=re.MULTILINE)
    yield from zip(found[1::2], found[2::2], strict=True)


def expanded(body: str, parts: Files, language: str, file: str) -> str:
    """Write out what is around a program, and its points, each line with its tags."""
    if file.endswith(".lsv"):
        return MACRO.sub(_listed, body)
    body = body.replace("~", parts.get("~", "").strip())
    if file == FIRST[language]:
        body = framed(body, parts)
    return "\n".join(_tagged(line, language) for line in body.splitlines()) + "\n"


def framed(body: str, parts: Files) -> str:
    """Put a program into the parts of the head whose word it lacks."""
    for name, text in reversed(parts.items()):
        lacks = name.partition(" without ")[2]
        if lacks and not re.search(lacks, body, re.MULTILINE):
            body = text.replace("%%\n", body)
    return re.sub(r"^START\n", parts.get("start", ""), body, flags=re.MULTILINE)


def _tagged(line: str, language: str) -> str:
    tags = [m[4] or m[0][1:-1] for m in MACRO.finditer(line)]
    line = MACRO.sub(lambda m: point(m, language), line)
    return f"{line} {COMMENT[language]} @{' @'.join(tags)}" if tags else line


def _listed(macro: re.Match[str]) -> str:
    numbers = NUMBER.findall(point(macro, "pdl2"))
    return "  ".join(f" {k}: {v}" for k, v in zip("XYZAER", numbers, strict=True))


@cache
def points() -> Mapping[str, np.ndarray]:
    """Return x, y, z [mm], quaternion (scalar first), six joints [deg] by name."""
    rows = [line.split() for line in (FOLDER / "points.txt").read_text().splitlines()]
    return {row[0]: np.array([float(x) for x in row[1:]]) for row in rows}


def turn(name: str) -> Rotation:
    """Return the orientation of a point."""
    return Rotation.from_quat(points()[name][[4, 5, 6, 3]])


def point(macro: re.Match[str], language: str) -> str:
    """Write a point in a language."""
    row = points()[macro[1]]
    if macro[2] == ".j":
        return _joints([f"{v:.4f}" for v in row[7:]], language)
    shift = [float(x) for x in re.findall(r"[-+][\d.]+", macro[3] or "")]
    place = [f"{v:.3f}" for v in row[:3] + (shift or np.zeros(3))]
    if language == "rapid":
        quaternion = ",".join(f"{v:.7f}" for v in row[3:7])
        return f"[[{','.join(place)}],[{quaternion}],[0,0,0,0],{OUTSIDE}]"
    order = "ZYX" if language == "krl" else "ZYZ"
    angles = [f"{v:.5f}" for v in turn(macro[1]).as_euler(order, degrees=True)]
    if language == "krl":
        named = zip("XYZABC", place + angles, strict=True)
        return "{" + ",".join(f"{k} {v}" for k, v in named) + ",S 2,T 6}"
    return f"POS({', '.join(place + angles)}, '')"


def _joints(angles: Sequence[str], language: str) -> str:
    if language == "rapid":
        return f"[[{','.join(angles)}],{OUTSIDE}]"
    if language == "krl":
        return "{" + ",".join(f"A{k + 1} {v}" for k, v in enumerate(angles)) + "}"
    return "{" + ", ".join(angles) + "}"


def run(files: Files, cell: Cell, model: Model, language: str) -> Run:
    """Compensate a program."""
    data = {name: text.encode("latin-1") for name, text in files.items()}
    first, listed = data.pop(FIRST[language]), data.pop("job.lsv", None)
    try:
        found = compensate(
            first, cell, model, name=FIRST[language], variables=listed, pages=data,
            options=Options(timing=False),
        )  # fmt: skip
    except PostprocError:
        return Run(None, 2, {})
    return Run(changes(files, found, language), found.exit_code, doubts(files, found))


def changes(files: Files, found: Outcome, language: str) -> Changes:
    """Return by how much the numbers of every tagged target changed."""
    total: dict[str, np.ndarray] = {}
    length = 7 if language == "rapid" else 6  # flags and external axes stand behind
    for name, text in files.items():
        output = found.outputs.get(name, text.encode("latin-1")).decode("latin-1")
        old, new = literals(text, language), literals(output, language)
        total |= {tag: new[tag][:length] - old[tag][:length] for tag in old}
    for tag in [tag for tag in total if tag[0] in "+*"]:  # numbers of Offs and RelTool
        more = total.pop(tag)
        more = turn(tag[1:]).apply(more) if tag[0] == "*" else more
        total[tag[1:]] += np.r_[more, np.zeros(length - 3)]
    return total


def literals(text: str, language: str) -> dict[str, np.ndarray]:
    """Return the numbers of every tagged target."""
    numbers = {tag: _numbers(values) for tag, values in LISTED.findall(text)}
    for line in text.splitlines():
        code, *tags = line.split(" @")
        found = re.findall(TARGET[language], code)
        if tags and tags[0][0] in "+*":
            found = re.findall(SHIFT, code)[-1:]
        for tag, part in zip(tags, found, strict=False):
            assert tag not in numbers or tag[0] == "x", tag
            numbers[tag] = _numbers(part)
    return numbers


def _numbers(text: str) -> np.ndarray:
    return np.array([float(x) for x in NUMBER.findall(text)])


def doubts(files: Files, found: Outcome) -> dict[str, float]:
    """Return the stated errors of directions and shared points, by tag [mm]."""
    stated: dict[str, float] = {}
    for finding in found.diagnostics:
        text = str(finding)
        match = UNCERTAIN.match(text) or MAYBE.match(text) or SHARED.match(text)
        if match and match[1] in files:
            line = files[match[1]].splitlines()[int(match[2]) - 1]
            size = float(match[3] or PASSED)
            stated |= {
                tag: max(size, stated.get(tag, 0.0)) for tag in _tags_of(line, files)
            }
    return stated


def _tags_of(line: str, files: Files) -> Iterator[str]:
    yield from line.split(" @")[1:]
    words = {word.lower() for word in re.findall(r"\w+", line)}
    for other in "\n".join(files.values()).splitlines():
        name = DECLARED.match(other)
        if name and name[1].lower() in words:
            yield from other.split(" @")[1:]


def judge(trap: Run, plain: Sequence[Run]) -> Verdict:
    """Compare what became of a trap with its plain programs."""
    if trap.changes is None:
        return Verdict("refused")
    assert all(p.changes is not None for p in plain), "a plain program is refused"
    words = {tag: _judge(trap, plain, tag) for tag in trap.changes if tag[0] != "x"}
    for word in ("wrong", "left", "middle"):
        if word in words.values():
            return Verdict(word, ", ".join(f"{tag}: {w}" for tag, w in words.items()))
    return Verdict("right")


def _judge(trap: Run, plain: Sequence[Run], tag: str) -> str:
    change = trap.changes[tag]
    wanted = [p.changes[tag] for p in plain if tag in p.changes]
    if not change.any():
        return _left(trap, wanted)
    if not wanted:
        return "wrong"
    off = max(np.abs(change - other).max() for other in wanted)
    if off <= TOLERANCE:
        return "right"
    return "middle" if off <= 2 * trap.doubts.get(tag, 0.0) else "wrong"


def _left(trap: Run, wanted: Iterable[np.ndarray]) -> str:
    wanted = list(wanted)
    if not any(change.any() for change in wanted):
        return "right"
    if trap.exit_code == 0:
        return "wrong"
    same = max(np.abs(change - wanted[0]).max() for change in wanted) <= TOLERANCE
    return "left" if same else "right"
