"""Lines that divide a block and open another one."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from postproc.language.text.source import Source, source_from_bytes
from postproc.language.text.statement_table import read_lines
from tests.reference.logical import logical_lines
from tests.reference.text import form_of, mask_line, masks_of


def rows(text: str) -> list[tuple[str, int, list[float]]]:
    lines = read_lines(source_from_bytes("job.pdl", text.encode("latin-1")))
    return [
        (
            masks_of(lines.shapes)[int(lines.shape[row])].replace("\x00", "N"),
            int(lines.begin_line[row]),
            lines.value[lines.first[row] : lines.first[row + 1]].tolist(),
        )
        for row in range(len(lines))
    ]


def test_the_block_behind_case_gets_a_row_with_its_own_numbers() -> None:
    text = "x := 9\nCASE (1, -2): FOR i := 3 TO 4 DO\ny := 8\n"
    assert rows(text) == [
        ("x := N", 1, [9.0]),
        ("CASE (N,N):", 2, [1.0, -2.0]),
        ("FOR i := N TO N DO", 2, [3.0, 4.0]),
        ("y := N", 3, [8.0]),
    ]


@pytest.mark.parametrize(
    "line",
    [
        "CASE (1): MOVE TO p", "CASE (1): IF a THEN b ENDIF", "ELSE", "ELSE IF a THEN",
        "CASE ('): IF a THEN'): x", "CASEIF (1): IF a THEN", "CASE (1): IFFY",
        "CASE (1): REPEATED",
    ],
)  # fmt: skip
def test_other_lines_are_one_row(line: str) -> None:
    assert len(rows(line + "\n")) == 1


def test_parentheses_and_strings_are_passed_over() -> None:
    text = "CASE (f(1), ')', '('): SELECT x OF"
    assert [row[0] for row in rows(text)] == ["CASE (f(N),')','('):", "SELECT x OF"]
    assert len(rows("ELSE:IF a THEN;")) == 2


PIECES = (
    "MOVE MOVEFLY OPEN SYNCMOVE SYNCMOVEFLY WITH ADVANCE TIL VIA CONDITION ENDMOVE "
    "ENDOPEN CASE ELSE IF SELECT FOR WHILE REPEAT ENDIF ENDFOR ENDWHILE moveX if_ lab "
    "l3 p1 $q ( ) : :: , ; 'a(' -1.5 2 -- x"
).split()
TEXT = st.lists(
    st.sampled_from([*PIECES, " ", "  ", "\n", "\r\n", ",\n", ",\r", ":\n", "\xe9"]),
    min_size=1,
    max_size=30,
)


@settings(max_examples=500, deadline=None)
@given(TEXT)
@example(["MOVE", " p1", ",\n", "WITH", " x", "\n", "WITH", " y", ",\n", "VIA"])
@example(["lab", "::", "MOVE", ",\n", "--", "\n", " ", "ENDMOVE", "\n", "ENDMOVE"])
@example(["CASE", "(", "'a('", "(", "2", ")", ")", ":", "IF", " p1", "-1.5"])
@example(["ELSE", " ", ":", "REPEAT", ";"])
def test_statements_are_joined_and_divided_by_the_definition(parts):
    source = Source("x", "".join(parts).encode("latin-1"))
    starts = [*source.line_starts.tolist(), len(source.data)]
    texts = [source.data[a:b] for a, b in pairwise(starts)]
    masked = [mask_line(t.decode("latin-1").rstrip("\r\n")) for t in texts]
    if any(line.unterminated for line in masked):
        return
    lines, forms = read_lines(source), [form_of(line.mask) for line in masked]
    wanted = logical_lines([form for form, _ in forms])
    own = lines.shapes.form[lines.shape].tolist()
    found = [lines.shapes.texts[k] for k in own]
    assert found == [one.form for one in wanted]
    assert lines.begin_line.tolist() == [one.line for one in wanted]
    counts = [one.form.count("\0") for one in wanted]
    assert lines.first.tolist() == np.cumsum([0, *counts]).tolist()
    names = [name for k in lines.shape.tolist() for name in lines.shapes.names_of(k)]
    assert names == [name for _, own_names in forms for name in own_names]
