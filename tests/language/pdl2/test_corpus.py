"""The chapters of the language: every case is a program and what it does."""

from pathlib import Path

import pytest

from postproc.language.language import JobReading, Start
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.number_edits import edits
from postproc.language.text.source import apply, source_from_bytes
from postproc.language.visits import ELSEWHERE, START, Meaning
from postproc.robot.trajectory import Motion

CORPUS = Path(__file__).parents[2] / "corpus"
CELL = Start(
    aux={1: "gun"},
    routines={"ext": "motionless", "outside": "motionless"},
    frame_tables={"tf": {"1, 2": {"tool": (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)}}},
)


def chapters() -> list[tuple[str, str, str]]:
    found = []
    for path in sorted(CORPUS.glob("*.txt")):
        for case in path.read_text("utf-8").split("==== ")[1:]:
            title, body = case.split("\n", 1)
            program, _, expected = body.partition("----\n")
            found.append((f"{path.stem}: {title}", program, expected))
    return found


def with_values(case: str) -> tuple[str, str]:
    """Return the program of a case, and its variable file ("" for none)."""
    program, _, values = case.partition("-- values\n")
    return program, values


def described(resolved: JobReading, *texts: str) -> str:
    """Return one line for each visit, then one for each diagnostic."""
    v = resolved.visits
    out = []
    for i in range(len(v)):
        origins = {START: "start", ELSEWHERE: "?"}
        before = [
            origins.get(p) or str(v.place.line[p])
            for p in v.graph.predecessors(i).tolist()
        ]
        word = Motion(v.motion.kind[i]).name + (" VIA" if v.motion.via[i] else "")
        literal = "-"
        if v.target.literal[i] >= 0:
            row = v.target.literal[i]
            places = zip(
                v.literals.places.start[row], v.literals.places.end[row], strict=True
            )
            text = texts[v.literals.file[row]]
            literal = ",".join(text[a:b] for a, b in places)
            literal += " taught" * bool(v.literals.taught[row])
        name = v.target.names[v.target.name[i]] or "-"
        parts = [
            f"{v.place.line[i]} {word} {Meaning(v.target.meaning[i]).name} {name}",
            f"from {'|'.join(before)}",
            f"numbers {literal}",
        ]
        parts += [f"measure {v.place.measure_id[i]}"] * bool(v.place.measure_id[i])
        kept = (
            v.literals.pinned[v.target.literal[i]] if v.target.literal[i] >= 0 else ""
        )
        parts += [f"stays, for {kept}"] * bool(kept)
        parts += [f"because {v.reasons[v.reason[i]].text}"] * bool(v.reason[i])
        out.append("; ".join(parts))
    out += [f"! {d.line} {d.code}" for d in resolved.diagnostics]
    return "\n".join(out) + "\n"


@pytest.mark.parametrize(
    ("title", "program", "expected"), chapters(), ids=[c[0] for c in chapters()]
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_chapter(title: str, program: str, expected: str, newline: str) -> None:
    files = [
        source_from_bytes(
            f"case.{suffix}", text.replace("\n", newline).encode("latin-1")
        )
        for suffix, text in zip(("pdl", "lsv"), with_values(program), strict=True)
        if text
    ]
    source, *listed = files
    variables = read_variables(listed[0]) if listed else None
    resolved = resolve(parse(source), CELL, variables)
    assert described(resolved, *(file.text for file in files)) == expected
    visits = resolved.visits
    same = edits(visits.literals, files, [], [], PDL2_DIALECT)
    for file, own in zip(files, same, strict=True):
        assert apply(file.data, own) == file.data
