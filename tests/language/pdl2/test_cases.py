"""Input, a line ``-- output``, expected: the first three numbers moved by 1.25."""

from pathlib import Path

import numpy as np
import pytest

from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.pose_encoding import PDL2_DIALECT
from postproc.language.pdl2.program import parse
from postproc.language.text.number_edits import difference, edits
from postproc.language.text.source import Source, apply, source_from_bytes

CASES = sorted((Path(__file__).parents[2] / "cases").glob("*.pdl"))


@pytest.mark.parametrize("newline", [b"\n", b"\r\n"])
@pytest.mark.parametrize("path", CASES, ids=[path.stem for path in CASES])
def test_case(path: Path, newline: bytes) -> None:
    parts = path.read_bytes().split(b"-- output\n")
    given, wanted = (part.replace(b"\n", newline) for part in parts)
    source = source_from_bytes(path.name, given)
    visits = resolve(parse(source)).visits
    rows = np.arange(len(visits.literals))
    first = [int(np.flatnonzero(visits.target.literal == row)[0]) for row in rows]
    new = visits.target.values[first] + [1.25, 1.25, 1.25, 0, 0, 0]
    (mine,) = edits(visits.literals, (source,), rows, new, PDL2_DIALECT)
    out = apply(given, mine)
    assert out == wanted
    assert difference(source, Source(path.name, out), mine) == ""
