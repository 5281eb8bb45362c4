"""Tables as people have them: Excel's, those without a header, lists of targets."""

from __future__ import annotations

from pathlib import Path

import pytest

from postproc.calibration.measurements import POSITION, read_points
from postproc.calibration.tables import TableFormat, read_foreign
from postproc.calibration.text_table import read_table
from postproc.exceptions import MeasurementError

HEADER = "id;q1_deg;q2_deg;x_mm;y_mm;z_mm"
ROWS = ("M0;1.5;2.5;10.25;20.5;30.75", "M1;-1.5;2;11.25;21.5;31.75")
PLAIN = [HEADER, *ROWS]


def written(path: Path, *lines: str, end: str = "\n", encoding: str = "utf-8") -> Path:
    """Write lines."""
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


EXCEL = {
    "sep line": ["sep=;", *PLAIN],
    "sep line quoted, in a row of cells": ['"sep=;";;;;;', *PLAIN],
    "sep line of a rare separator": ["sep=|", *(x.replace(";", "|") for x in PLAIN)],
    "sep line of tabs": ["sep=\t", *(x.replace(";", "\t") for x in PLAIN)],
    "separators at the ends": [x + ";;" for x in PLAIN],
    "separators at the ends of rows only": [HEADER, *(x + ";" for x in ROWS)],
    "separators at the end of the header only": [HEADER + ";;", *ROWS],
    "rows of empty cells": [*PLAIN[:2], ";;;;;", PLAIN[2], ";;;;;;;"],
    "comments above": ["# exported by the tracker PC", "# frame: base", *PLAIN],
    "comments between rows": [HEADER, "# warm-up", ROWS[0], "// again", ROWS[1]],
    "a row that is commented out": [HEADER, ROWS[0], "#" + ROWS[0], ROWS[1]],
    "comment with separators": ["# a;b;c;d;e;f;g;h", *PLAIN],
    "header behind a comment sign": ["# " + HEADER, *ROWS],
    "title above": ["Survey of cell 7", *PLAIN],
    "title in a row of cells": ["Survey of cell 7;;;;;", *PLAIN],
    "index without a name": [";" + HEADER, *(f"{k};{x}" for k, x in enumerate(ROWS))],
    "quoted cells": [HEADER, *('"' + x.replace(";", '";"') + '"' for x in ROWS)],
    "a quoted cell of two lines": [HEADER.replace("id", '"id\n"'), *ROWS],
    "blanks around": [x.replace(";", " ; ") for x in PLAIN],
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("name", EXCEL)
def test_a_table_as_excel_writes_it(tmp_path: Path, name: str, encoding: str) -> None:
    path = written(tmp_path / "t.csv", *EXCEL[name], end="\r\n", encoding=encoding)
    table = read_foreign(path)
    plain = read_foreign(written(tmp_path / "p.csv", *PLAIN))
    assert table.columns == plain.columns
    assert table.cells.tolist() == plain.cells.tolist()


def test_the_line_of_a_row_is_that_of_the_file(tmp_path: Path) -> None:
    lines = ["sep=;", "# a comment", HEADER, ROWS[0], ";;;;;", ROWS[1]]
    assert read_foreign(written(tmp_path / "t.csv", *lines)).line.tolist() == [4, 6]


def test_decimal_commas_between_blanks(tmp_path: Path) -> None:
    lines = [x.replace(";", "  ").replace(".", ",") for x in PLAIN]
    table = read_foreign(written(tmp_path / "t.txt", *lines))
    assert table.numbers("x_mm").tolist() == [10.25, 11.25]


def test_names_that_begin_with_a_sign_are_no_comments(tmp_path: Path) -> None:
    rows = [f"#{k};1;2;3;4;5" for k in range(8)]
    table = read_foreign(written(tmp_path / "t.csv", HEADER, *rows))
    assert table.text("id")[:2] == ["#0", "#1"] and len(table) == 8


@pytest.mark.parametrize(
    ("lines", "problem", "line"),
    [
        ([HEADER, ROWS[0], ROWS[1] + ";7"], "has 7 cells, the header names 6", 3),
        ([HEADER.replace("q2", "q1"), *ROWS], "column 'q1_deg' appears twice", 1),
        (["# nothing"], "has no measurements", None),
        ([HEADER], "has no measurements", None),
        (["sep=;"], "has no measurements", None),
    ],
)
def test_a_table_that_is_none_is_refused_in_our_words(
    tmp_path: Path, lines: list[str], problem: str, line: int | None
) -> None:
    path = written(tmp_path / "t.csv", *lines)
    with pytest.raises(MeasurementError, match=problem) as refused:
        read_table(path)
    assert f"{path}:{line}" in str(refused.value) or line is None


# Tables without a header.

MAP = """
[columns]
id = "1"
q1_deg = "2"
q2_deg = "3"
x_mm = "4"
y_mm = "5"
z_mm = "6"
"""


@pytest.mark.parametrize("header", ["", "\n[file]\nheader = false\n"])
@pytest.mark.parametrize("split", ["\t", ";", ",", "  "])
@pytest.mark.parametrize("above", [[], ["// DELMIA"], ["# id q1 q2 x y"]])
def test_a_table_without_a_header_is_read_by_number(
    tmp_path: Path, above: list[str], split: str, header: str
) -> None:
    rows = [x.replace(";", split) for x in ROWS]
    path = written(tmp_path / "t.txt", *above, *rows)
    (tmp_path / "map.toml").write_text(MAP + header)
    table = read_foreign(path, TableFormat(tmp_path / "map.toml"))
    assert table.text("id") == ["M0", "M1"]
    assert table.numbers("z_mm").tolist() == [30.75, 31.75]


def test_a_header_of_numbers_is_one(tmp_path: Path) -> None:
    path = written(tmp_path / "t.csv", "1;2;3;4;5;6", *ROWS)
    (tmp_path / "map.toml").write_text(MAP)
    assert len(read_foreign(path, TableFormat(tmp_path / "map.toml"))) == 2


def test_rows_of_names_alone_need_the_option(tmp_path: Path) -> None:
    path = written(tmp_path / "t.csv", "a;b;1", "c;d;2")
    text = '[columns]\nid = "2"\nx_mm = "3"\n[file]\nheader = false\n'
    (tmp_path / "map.toml").write_text(text)
    table = read_foreign(path, TableFormat(tmp_path / "map.toml"))
    assert table.text("id") == ["b", "d"]


def test_a_table_without_a_header_names_the_cure(tmp_path: Path) -> None:
    path = written(tmp_path / "t.csv", *ROWS)
    with pytest.raises(MeasurementError, match="has no header: its columns are 1 to 6"):
        read_foreign(path).require("id")
    (tmp_path / "map.toml").write_text('[columns]\nx_mm = "9"\n')
    with pytest.raises(MeasurementError, match="column 9 is missing"):
        read_foreign(path, TableFormat(tmp_path / "map.toml"))


# Lists of targets: SpatialAnalyzer's collection, group and target.

XYZ = ("450.8476 -1293.8727 1884.2251", "450.6593 -1293.4406 1884.9667")
LISTS = {
    "target": ["1a {}", "1b {}"],
    "group and target": ["Main 1a {}", "Main 1b {}"],
    "collection, group and target": ["A Main 1a {}", "A Main 1b {}"],
    "groups that differ": ["A North 1a {}", "A South 1b {}"],
    "quoted names with blanks": [
        '"A 1" "Main group" 1a {}',
        '"A 1" "Main group" 1b {}',
    ],
    "names with colons": ["A::Main::1a {}", "A::Main::1b {}"],
    "more numbers behind": ["A Main 1a {} 0 0 1", "A Main 1b {} 0 0 1"],
    "a row number in front": ["1 A Main 1a {}", "2 A Main 1b {}"],
}


@pytest.mark.parametrize("split", [" ", ",", "\t", ", "])
@pytest.mark.parametrize("name", LISTS)
def test_the_target_is_the_name(tmp_path: Path, name: str, split: str) -> None:
    if '"' in LISTS[name][0] and split != " ":
        pytest.skip("blanks within names need no quotes here")
    rows = [row.format(at) for row, at in zip(LISTS[name], XYZ, strict=True)]
    lines = ["// SpatialAnalyzer", "// Frame: A::base", *rows]
    if split != " ":
        lines = [x.replace(" ", split) for x in lines]
    points = read_points(written(tmp_path / "sa.txt", *lines))
    assert points.text("id") == ["1a", "1b"] and points.line.tolist() == [3, 4]
    assert points.block(POSITION)[0].tolist() == [450.8476, -1293.8727, 1884.2251]


@pytest.mark.parametrize("front", ["", "Main ", "A Main "])
def test_a_target_may_be_a_number(tmp_path: Path, front: str) -> None:
    rows = [f"{front}{k} {at}" for k, at in enumerate(XYZ, 7)]
    assert read_points(written(tmp_path / "sa.txt", *rows)).text("id") == ["7", "8"]


def test_a_header_names_the_target(tmp_path: Path) -> None:
    rows = [f"A,Main,{k}," + at.replace(" ", ",") for k, at in enumerate(XYZ)]
    path = written(tmp_path / "sa.txt", "Collection,Group,Target,X,Y,Z", *rows)
    assert read_points(path).text("id") == ["0", "1"]


def test_a_list_without_names_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "sa.txt", *XYZ)
    with pytest.raises(MeasurementError, match="not a name followed by x, y, z"):
        read_points(path)
