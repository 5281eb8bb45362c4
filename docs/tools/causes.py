"""Write the table of causes into docs/effects.md, from the effects themselves.

    python docs/tools/causes.py

Rows are what moves, columns what drives it, entries the effects with a name there.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from postproc.model.carrier import carrier
from postproc.model.effects import EFFECTS

PAGE = Path(__file__).parents[1] / "effects.md"
BEGIN, END = "<!-- table of causes -->", "<!-- end of the table -->"
ROWS = {
    "joint": "a joint, about its own axis",
    "link turn": "a link, across the joint before it",
    "link shift": "a link, shifted",
    "base turn": "the base, turned",
    "base shift": "the base, shifted",
    "tool turn": "the tool, turned",
    "tool shift": "the tool, shifted",
}
COLUMNS = {
    "constant": "always",
    "joint": "angles",
    "lambda": "direction λ",
    "way": "way since a reversal",
    "torque": "torque",
    "moment": "moment across",
    "payload": "payload",
    "temperature": "temperature",
    "time": "time, order",
    "speed": "speed",
    "x": "products",
}


def row_of(place: str) -> str:
    """Find the row of a carrier."""
    moved = carrier(place)
    return "joint" if moved.part == "joint" else f"{moved.part} {moved.motion}"


def column_of(driver: str) -> str:
    """Find the column of a driver."""
    if " x " in driver:
        return "x"
    kind = driver.partition(" ")[0]
    return "time" if kind == "order" else kind


def entries() -> Iterator[tuple[str, str, str]]:
    """List row, column and name of every effect."""
    for kind in EFFECTS:
        for place, driver, _ in kind.cells:
            yield row_of(place), column_of(driver), kind.name
        for row, column in kind.acts:
            yield row, column, kind.name


def table() -> str:
    """Write the table."""
    names: dict[tuple[str, str], list[str]] = defaultdict(list)
    for row, column, name in entries():
        if name not in names[row, column]:
            names[row, column].append(name)
    lines = ["| what moves | " + " | ".join(COLUMNS.values()) + " |"]
    lines.append("|---" * (len(COLUMNS) + 1) + "|")
    for row, text in ROWS.items():
        cells = (", ".join(names[row, column]) for column in COLUMNS)
        lines.append(f"| {text} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def written(page: str) -> str:
    """Put the table into a page, between its marks."""
    between = re.compile(f"{BEGIN}.*?{END}", re.DOTALL)
    return between.sub(lambda _: f"{BEGIN}\n\n{table()}\n\n{END}", page)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
