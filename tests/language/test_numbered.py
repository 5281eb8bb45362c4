"""Numbered names are taken out of whole files as they are out of one line."""

import random
from typing import Any

import numpy as np
import pytest

from postproc.language.text.lexer import mask_of, scan_lines
from postproc.language.text.source import Source, source_from_bytes
from postproc.language.text.statement_table import Statements, read_lines
from tests.reference.text import HIDDEN, form_of, mask_line, masks_of

PIECES = (
    "MOVE TO WP_1 p2 _a3b x $v1 a$b2 weld l1:: 7up 'p3' '\\'q4' \"r5\" :: , := ( ) [ ] "
    "5 -1.5 1..n 2e3 \x01 \xe9t6 t\xe97 W8\xe9 a.b9 c1.5 -- d1\t:: VAR POSITION + {"
).split(" ")


def text(rng: random.Random, lines: int) -> bytes:
    """Write lines of names, and of what may be taken for one."""
    written = [
        rng.choice(["", " ", "   "]).join(rng.choices(PIECES, k=rng.randrange(9)))
        for _ in range(lines)
    ]
    far = [f"p{k}{' ' * (k % 80)}::" for k in range(160)]
    return "\n".join([*written, *far, "END"]).encode("latin-1")


def test_whole_files_are_read_as_line_by_line() -> None:
    data = text(random.Random(8), 4000)
    found = scan_lines(data, Source("x", data).line_starts)
    taken = 0
    for row, line in enumerate(data.split(b"\n")):
        wanted = mask_line(line.decode("latin-1")).mask
        own = found.name[found.name_first[row] : found.name_first[row + 1]]
        names = tuple(found.names[k] for k in own)
        mask = found.masks[found.shape[row]].decode("latin-1")
        assert (mask, names) == form_of(wanted)
        assert mask_of(*form_of(wanted)) == wanted
        taken += len(names)
    assert taken > 300


def shapes_of(data: bytes) -> tuple[Statements[Any], list[str]]:
    lines = read_lines(source_from_bytes("x", data))
    masks = masks_of(lines.shapes)
    return lines, [masks[k] for k in lines.shape.tolist()]


def test_shapes_are_what_lines_say_without_numbers() -> None:
    sound = [p for p in PIECES if p not in ("'\\'q4'", "--", ",", "1..n", "::")]
    rng = random.Random(3)
    said = [" ".join(rng.choices(sound, k=rng.randrange(1, 5))) for _ in range(3000)]
    lines, found = shapes_of("\n".join(said).encode("latin-1"))
    masks = [mask_line(line).mask.strip() for line in said]
    assert found == [mask for mask in masks if mask]
    assert len(lines.shapes) == len({*found}) == len({*masks_of(lines.shapes)})
    assert [*dict.fromkeys(found)] == masks_of(lines.shapes)
    forms = {form_of(mask)[0] for mask in found}
    assert {*lines.shapes.texts} == forms


@pytest.mark.parametrize("behind", ["", ' -- "odd"', " -- \\"])
def test_a_name_is_the_same_where_its_line_is_odd(behind: str) -> None:
    text = f"MOVE TO p1 ,{behind}\n  WITH CONDITION[c2],\nENDMOVE\nMOVE TO p1"
    lines, found = shapes_of(text.encode())
    joined = "MOVE TO p1 , WITH CONDITION[c2], ENDMOVE"
    assert found == [joined, "MOVE TO p1"]
    plain, _ = shapes_of(text.replace(behind, "").encode())
    assert lines.shapes == plain.shapes
    other, _ = shapes_of(text.replace("c2", "c3").encode())
    assert lines.shapes != other.shapes
    assert lines.shapes.names_of(0) == ("p1", "c2")
    ((name,),) = lines.shapes.names_at(np.array([1]))
    assert lines.shapes.names[name] == "p1"


def test_a_string_may_hold_the_character_that_marks_names() -> None:
    _, found = shapes_of(b"x1 := '\x01'\nx2 := 'y'")
    assert found == [f"x1 := '{HIDDEN}'", "x2 := 'y'"]
