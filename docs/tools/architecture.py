"""Draw the chapters of the package, what they import and what travels between them.

    python docs/tools/architecture.py            write docs/pictures/architecture.svg
    python docs/tools/architecture.py --check    fail if that picture is out of date

The roles are the first sentences of the chapters' docstrings, the grey lines their
imports. A label that begins with a capital is a class: the drawing fails where the
code on either side of its arrow does not name it, or where an import points up.
"""

from __future__ import annotations

import ast
import sys
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "postproc"
PICTURE = ROOT / "docs/pictures/architecture.svg"

# Lowest first; what is not a chapter is a leaf, below all of them.
LAYERS = (
    ("robot",),
    ("language", "motion", "model"),
    ("verify",),
    ("compensation", "simulation"),
    ("calibration",),
    ("record",),
    ("report",),
    ("batch",),
    ("cli",),
)
WIDTH, HEIGHT = 860, 700
BOXES = {  # x, y, width, height
    "cli": (20, 15, 820, 48),
    "batch": (500, 95, 250, 62),
    "report": (235, 120, 245, 62),
    "record": (60, 120, 162, 62),
    "calibration": (20, 225, 200, 105),
    "compensation": (290, 225, 345, 105),
    "simulation": (660, 225, 180, 105),
    "verify": (600, 360, 170, 85),
    "model": (150, 475, 200, 80),
    "motion": (375, 475, 180, 80),
    "language": (580, 475, 260, 80),
    "robot": (150, 605, 500, 48),
}
STEPS = ("Visits", "Targets", "Plan", "States", "Decisions", "Outcome")
FILES = {"survey.csv": (20, 515), "job.pdl": (711, 616)}


@dataclass(frozen=True)
class Arrow:
    """What travels from one chapter (or file) to another, and where it is drawn."""

    label: str
    maker: str
    user: str
    start: tuple[int, int]
    end: tuple[int, int]
    left: bool = False  # the label stands to the left of the arrow


FLOW = (
    Arrow("Measurements", "survey.csv", "calibration", (55, 513), (55, 330)),
    Arrow("bytes", "job.pdl", "language", (750, 614), (750, 555)),
    Arrow("Arm, States", "robot", "model", (230, 605), (230, 555)),
    Arrow("Arm", "robot", "motion", (467, 605), (467, 555)),
    Arrow("Effect", "model", "calibration", (190, 475), (190, 330)),
    Arrow("States", "compensation", "model", (310, 330), (310, 475), left=True),
    Arrow("Targets", "compensation", "motion", (410, 330), (410, 475), left=True),
    Arrow("Plan", "motion", "compensation", (500, 475), (500, 330), left=True),
    Arrow("Visits", "language", "compensation", (585, 475), (585, 330), left=True),
    Arrow("Claim", "compensation", "verify", (618, 330), (618, 360)),
    Arrow("Visits", "language", "verify", (690, 475), (690, 445)),
    Arrow("Visits", "language", "simulation", (785, 475), (785, 330)),
    Arrow("Model", "calibration", "compensation", (220, 290), (290, 290)),
    Arrow("Measurements", "calibration", "report", (219, 225), (245, 182)),
    Arrow("Outcome", "compensation", "report", (370, 225), (370, 182)),
    Arrow("Outcome", "compensation", "batch", (540, 225), (540, 157)),
    Arrow("Extension", "calibration", "cli", (30, 225), (30, 63)),
    Arrow("Summary", "batch", "cli", (610, 95), (610, 63)),
)
LINES = {  # grey: upper chapter, lower chapter, from, to
    ("cli", "report"): ((315, 63), (315, 120)),
    ("report", "simulation"): ((480, 172), (690, 225)),
    ("report", "record"): ((235, 150), (222, 150)),
    ("record", "calibration"): ((150, 182), (150, 225)),
    ("language", "robot"): ((615, 555), (615, 605)),
}


def chapters() -> set[str]:
    """List the folders of the package that hold code."""
    return {path.parent.name for path in PACKAGE.glob("*/__init__.py")}


@cache
def nodes(chapter: str) -> tuple[ast.ClassDef | ast.ImportFrom, ...]:
    """Read the classes and imports in the modules of a chapter."""
    texts = (p.read_text(encoding="utf-8") for p in (PACKAGE / chapter).rglob("*.py"))
    every = (node for text in texts for node in ast.walk(ast.parse(text)))
    return tuple(n for n in every if isinstance(n, ast.ClassDef | ast.ImportFrom))


def imports(chapter: str) -> set[tuple[str, str]]:
    """List (chapter, name) of all that a chapter imports from others."""
    found = set()
    for node in nodes(chapter):
        if isinstance(node, ast.ImportFrom) and node.module:
            package, _, rest = node.module.partition(".")
            if package == PACKAGE.name:
                other = rest.partition(".")[0]
                found |= {(other or a.name, a.name) for a in node.names}
    return {(other, name) for other, name in found if other != chapter}


def names(chapter: str) -> set[str]:
    """List the classes that a chapter defines and all names that it imports."""
    own = {node.name for node in nodes(chapter) if isinstance(node, ast.ClassDef)}
    return own | {name for _, name in imports(chapter)}


def problems() -> Iterator[str]:
    """Say what is wrong with the drawing, or that the picture is not of it."""
    wrong = list(differences())
    if not wrong and PICTURE.read_text(encoding="utf-8") != drawing():
        wrong = ["it is out of date: run python docs/tools/architecture.py"]
    yield from (f"{PICTURE.name}: {text}" for text in wrong)


def differences() -> Iterator[str]:
    """Say where the drawing and the package differ."""
    level = {name: k for k, layer in enumerate(LAYERS) for name in layer}
    if chapters() != set(level) or set(BOXES) != set(level):
        yield f"the chapters are {sorted(chapters())}, drawn are {sorted(BOXES)}"
        return
    known = {name: names(name) for name in level}
    uses = {name: {other for other, _ in imports(name)} for name in level}
    for name in level:
        for other in sorted(uses[name] & set(level)):
            if level[other] >= level[name]:
                yield f"{name} imports {other}, which is not below it"
    for arrow in FLOW:
        for label in arrow.label.split(", "):
            for end in {arrow.maker, arrow.user} & set(level):
                if label[0].isupper() and label not in known[end]:
                    yield f"{label} is not known in {end}"
    for name, place in BOXES.items():
        if 38 + 16 * len(rows(name)) - 8 > place[3]:
            yield f"what {name} says of itself does not fit into its box"
    for upper, lower in LINES:
        if lower not in uses[upper]:
            yield f"{upper} does not import {lower}"
    yield from (f"no class {s}" for s in STEPS if s not in known["compensation"])


def role(chapter: str) -> str:
    """Return the first sentence of a chapter's docstring, without its name."""
    tree = ast.parse((PACKAGE / chapter / "__init__.py").read_text(encoding="utf-8"))
    text = " ".join((ast.get_docstring(tree) or "").split()).partition(". ")[0]
    head, _, rest = text.rstrip(".").partition(": ")
    text = rest if head.lower().startswith(chapter) else text.rstrip(".")
    return text[:1].upper() + text[1:]


def rows(chapter: str) -> list[str]:
    """Break a chapter's role into the rows that its box has room for."""
    return textwrap.wrap(role(chapter), int((BOXES[chapter][2] - 16) / 6.6))


def leaves() -> str:
    """Name the modules below all chapters."""
    found = {path.stem for path in PACKAGE.glob("*.py*")}
    return ", ".join(sorted(name for name in found if not name.startswith("__")))


def drawing() -> str:
    """Return the picture."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="system-ui, DejaVu Sans, sans-serif">',
        "<title>The chapters of the package and what travels between them</title>",
        '<marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0 10 5 0 10z" fill="#00568a"/>'
        "</marker>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#fff"/>',
        *(line(*ends) for ends in LINES.values()),
        *(text for arrow in FLOW for text in drawn(arrow)),
        *(text for name, place in BOXES.items() for text in box(name, *place)),
        *(text for name, place in FILES.items() for text in file(name, *place)),
        *below(),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def line(start: tuple[int, int], end: tuple[int, int]) -> str:
    """Draw a grey line: the upper chapter uses the lower one."""
    (a, b), (c, d) = start, end
    return f'<path d="M{a} {b} {c} {d}" stroke="#aaa" stroke-width="1.5"/>'


def drawn(arrow: Arrow) -> Iterator[str]:
    """Draw what travels."""
    (a, b), (c, d) = arrow.start, arrow.end
    yield (
        f'<path d="M{a} {b} {c} {d}" stroke="#00568a" stroke-width="2" '
        'marker-end="url(#head)"/>'
    )
    x, y, anchor = a + 7, (b + d) / 2 + 4, "start"
    if b == d:
        x, y, anchor = (a + c) // 2, b - 8, "middle"
    elif arrow.left:
        x, anchor = a - 7, "end"
    bold = 'font-weight="600" fill="#00568a" font-size="13"'
    yield f'<text x="{x}" y="{y:g}" text-anchor="{anchor}" {bold}>{arrow.label}</text>'


def box(name: str, x: int, y: int, width: int, height: int) -> Iterator[str]:
    """Draw a chapter with its role."""
    main = name in ("compensation", "calibration")
    fill = "#e3eef7" if main else "#f4f4f2"
    yield (
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="5" '
        f'fill="{fill}" stroke="#666"/>'
    )
    large = 'font-size="15" font-weight="700"'
    yield f'<text x="{x + 10}" y="{y + 20}" {large}>{name}</text>'
    yield from written(rows(name), x + 10, y + 38)
    if name == "compensation":
        inside = "".join(steps(x + 10, y + 78))
        yield f'<g font-style="italic" fill="#00568a">{inside}</g>'


def steps(x: int, y: int) -> Iterator[str]:
    """Write what a program becomes on its way."""
    half = len(STEPS) // 2
    return written([" → ".join(STEPS[:half]) + " →", " → ".join(STEPS[half:])], x, y)


def written(texts: Iterable[str], x: int, y: int) -> Iterator[str]:
    """Write rows of small text."""
    for k, row in enumerate(texts):
        yield f'<text x="{x}" y="{y + 16 * k}" font-size="12">{escape(row)}</text>'


def file(name: str, x: int, y: int) -> Iterator[str]:
    """Draw a file that comes from outside."""
    yield (
        f'<rect x="{x}" y="{y}" width="78" height="26" rx="2" fill="#fff" '
        'stroke="#666" stroke-dasharray="4 3"/>'
    )
    yield f'<text x="{x + 8}" y="{y + 17}" font-size="12">{name}</text>'


def below() -> Iterator[str]:
    """Write what all chapters may use, and what the lines mean."""
    told = (
        f"below all: {leaves()}",
        "blue: what travels; grey: the upper uses the lower",
    )
    for text, x, anchor in zip(told, (20, WIDTH - 20), ("start", "end"), strict=True):
        place = f'x="{x}" y="{HEIGHT - 18}" text-anchor="{anchor}"'
        yield f'<text {place} font-size="12" fill="#555">{text}</text>'


def main(arguments: list[str]) -> int:
    """Write the picture, or check it."""
    if "--check" not in arguments and not list(differences()):
        PICTURE.write_text(drawing(), encoding="utf-8")
    wrong = list(problems())
    for text in wrong:
        print(text, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
