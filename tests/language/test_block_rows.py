"""Lines that divide a block and open another one."""

import pytest

from postproc.language.text.logical_lines import read_lines
from postproc.language.text.source import source_from_bytes
from tests.reference.text import masks_of


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
