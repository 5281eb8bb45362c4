"""The tables of a page as CSV and as workbooks."""

from __future__ import annotations

import csv
import json
import re

import pytest
from openpyxl import load_workbook

from postproc.report.html.target_fields import COLUMNS
from postproc.report.sheets import Sheet, sheets_of_page, table_files
from tests.written import FIRST, NEXT, POSE, cli, program

PAGE = """<table><tr><td>not in main</td></tr><tr><td>1</td></tr></table><main>
<section><h2>Two <b>words</b></h2><table><tr><th>a</th><th>b</th></tr>
<tr><td> −1.50 </td><td>–</td></tr><tr><td>=x()</td><td>1.2 mm</td></tr></table>
</section>
<section><table data-sheet="named"><tr><th>k</th></tr><tr><td>7</td></tr></table>
<table data-copy="yes"><tr><td>1</td></tr><tr><td>2</td></tr></table>
<table><tr><th>filled by a script</th></tr></table></section></main>"""


def test_the_tables_of_a_page_are_found():
    found = sheets_of_page(PAGE)
    assert [sheet.title for sheet in found] == ["Two words", "named"]
    assert found[0].rows == [["a", "b"], [-1.5, ""], ["=x()", "1.2 mm"]]
    assert found[1].rows == [["k"], [7]]


def test_csv_has_a_file_a_table_and_a_workbook_a_sheet_a_table(tmp_path):
    sheets = [*sheets_of_page(PAGE), Sheet("named", [["x"], [1]])]
    files = table_files(tmp_path / "t.csv", sheets)
    assert [path.name for path in files] == ["t.csv", "t-named.csv", "t-named-2.csv"]
    rows = next(iter(files.values())).decode("utf-8-sig").splitlines()
    assert rows == ["a,b", "-1.5,", "'=x(),1.2 mm"]  # no formula
    (place, data), *_ = table_files(tmp_path / "t.xlsx", sheets).items()
    place.write_bytes(data)
    book = load_workbook(place)
    assert book.sheetnames == ["Two words", "named", "named 2"]
    assert book["named"]["A2"].value == 7 and book["Two words"]["A3"].data_type == "s"


def test_compensate_writes_all_targets_as_the_report_has_them(desk):
    place, table = desk.folder / "job.pdl", desk.folder / "t.csv"
    place.write_bytes(program(FIRST, POSE, NEXT))
    report, page = desk.folder / "r.json", desk.folder / "r.html"
    done = cli(
        "compensate", place, "--cell", desk.cell, "--model", desk.model, "-o",
        desk.folder / "o.pdl", "--tolerance", 1, "--table", table, "--report", report,
        "--report", page,
    )  # fmt: skip
    assert done.exit_code == 0, done.stderr
    rows = list(csv.reader(table.read_text("utf-8-sig").splitlines()))
    data = json.loads(report.read_bytes())
    assert rows[0] == [field.heading for field, _ in COLUMNS]
    assert len(rows) == 1 + len(data["targets"])
    told = [
        dict(zip([f.key for f, _ in COLUMNS], row, strict=True)) for row in rows[1:]
    ]
    for row, target in zip(told, data["targets"], strict=True):
        assert row["line"] == str(target["line"]) and row["status"] == target["status"]
        assert float(row["bound"]) == pytest.approx(target["bound_95_mm"], abs=6e-4)
    assert {row["verdict"] for row in told} <= {"pass", "no target"}
    fields = re.search(r'"fields":(\[.*?\}\])', page.read_text()).group(1)
    assert [f["key"] for f in json.loads(fields)] == [f.key for f, _ in COLUMNS]


def test_another_ending_is_refused(desk):
    done = cli("iso9283", "r.csv", "--table", "t.ods")
    assert done.exit_code == 2 and "write FILE.csv or FILE.xlsx" in done.stderr
