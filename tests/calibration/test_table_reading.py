"""Exports of many tools in three languages are read, or asked about."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.survey_files import read_measurements
from postproc.calibration.tables import TableFormat
from postproc.exceptions import MeasurementError
from postproc.robot.cell import load_cell
from tests.calibration import exports
from tests.calibration.exports import LOCALES, Rows
from tests.written import cli

CELL = f"""
[robot]
arm = "nj220-2.7"
[survey]
points_mm = [{list(exports.TOOL)}]
"""


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Rows]:
    """A folder with a cell and a survey program, and what was measured there."""
    folder = tmp_path_factory.mktemp("survey")
    (folder / "cell.toml").write_text(CELL)
    at = ("--cell", folder / "cell.toml")
    assert cli("survey", *at, "--poses", 16, "-o", folder / "s.pdl").exit_code == 0
    assert cli("simulate", folder / "s.pdl", *at, "-o", folder / "m.csv").exit_code == 0
    found = read_measurements(folder / "m.csv", cell=load_cell(folder / "cell.toml"))
    rows = Rows(found.ids, np.rad2deg(found.states.q), found.position * 1e3)
    return folder, rows


def check(path: Path, survey: tuple[Path, Rows], joined: bool, *given: str) -> str:
    """Read a file as `fit` does, else with the map of `read`; compare all numbers."""
    folder, rows = survey
    changes = tuple(g for g in given if "." in g.split("=")[0])
    cell = load_cell(folder / "cell.toml", changes=changes)
    program = folder / "s.pdl" if joined else None
    how, reading = "as it is", TableFormat()
    try:
        found = read_measurements(path, cell=cell, program=program)
    except MeasurementError:
        form = path.with_suffix(".map.toml")
        more = ("--program", program) if joined else ()
        done = cli("read", path, "--cell", folder / "cell.toml", "-o", form, *more,
                   *(word for c in changes for word in ("--set", c)))  # fmt: skip
        assert done.exit_code == 0, done.stderr
        how, reading = "with its map", TableFormat(columns=form)
        found = read_measurements(path, cell=cell, program=program, reading=reading)
    if found.ids[0] == rows.ids[0]:  # else the layout has no names
        assert found.ids == rows.ids
    np.testing.assert_allclose(np.rad2deg(found.states.q), rows.q, atol=1e-5)
    np.testing.assert_allclose(found.position * 1e3, rows.xyz, atol=2e-4)
    np.testing.assert_allclose(found.states.tool * 1e3, [exports.TOOL] * len(rows.ids))
    return how


NEED_A_MAP = {"radians_and_metres", "bare_joints"}


@pytest.mark.parametrize("locale", LOCALES)
@pytest.mark.parametrize("layout", [*exports.JOINTS, *exports.POINTS])
def test_an_export_is_read(layout, locale, survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    at = LOCALES[locale]
    path = tmp_path / "export.csv"
    path.write_bytes(layout(survey[1], at).encode(at.encoding))
    how = check(path, survey, layout in exports.POINTS)
    assert (how == "with its map") == (layout.__name__ in NEED_A_MAP)


@pytest.mark.parametrize("locale", LOCALES)
@pytest.mark.parametrize("as_text", [False, True])
def test_a_workbook_is_read(as_text, locale, survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("openpyxl")
    path = tmp_path / "export.xlsx"
    path.write_bytes(exports.workbook(survey[1], LOCALES[locale], as_text))
    assert check(path, survey, False) == "as it is"


@pytest.mark.parametrize("layout", [*exports.JOINTS, *exports.POINTS])
def test_read_says_what_is_understood(layout, survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder, rows = survey
    path = tmp_path / "export.csv"
    path.write_bytes(layout(rows, LOCALES["de"]).encode("latin-1"))
    joined = ("--program", folder / "s.pdl") if layout in exports.POINTS else ()
    done = cli("read", path, "--cell", folder / "cell.toml", *joined)
    assert done.exit_code == 0, done.stderr
    assert f"export.csv: {len(rows.ids)} rows" in done.stdout
    assert "decimal sign ','" in done.stdout
    assert ("s.pdl, joined by id: 32 rows" in done.stdout) == bool(joined)
    assert "mm (median) from the poses of the nominal arm" in done.stdout


def put(survey: tuple[Path, Rows], folder: Path, *lines: str) -> tuple[str, Path]:
    """Write a file; return the cell's place and the file."""
    path = folder / "t.csv"
    path.write_text("\n".join(lines) + "\n")
    return str(survey[0] / "cell.toml"), path


JOINTS = ["12.5", "-20.25", "31.5", "40", "-50.75", "60"]
HEAD = ["Name", *exports.axes("A{}"), "X", "Y", "Z"]
ROW = ["P1", *JOINTS, "1450.848", "-293.873", "1884.225"]
SMALL = ["P1", *["0.5", "-1.25", "1.5", "2.0", "-0.75", "3.1"]]
ASKED = {
    "two columns for one": (
        [[*HEAD, "X Actual"], [*ROW, "1450.9"]],
        ["x_mm may be column 'X Actual' or 'X'", "--column 'x_mm=X Actual'"],
    ),
    "two columns for a joint": (
        [[*HEAD, "A1 Ist"], [*ROW, "12.5"]],
        ["q1_deg may be column 'A1' or 'A1 Ist'"],
    ),
    "degrees or radians": (
        [HEAD, [*SMALL, *ROW[-3:]]],
        ["joint angles have no unit", "may be deg or rad", "measurements.angle_unit"],
    ),
    "metres or feet": (
        [HEAD, [*ROW[:7], "1.45", "-0.29", "1.88"]],
        ["x, y, z have no unit", "may be mm, m or ft", "measurements.unit=mm"],
    ),
    "thousands or a decimal comma": (
        [HEAD, ["P1", *["1,500"] * 6, "450,848", "293,873", "884,225"]],
        ["1,500 may be 1.500 or 1500", "measurements.decimal"],
    ),
    "a point among commas": (
        [HEAD, ["P1", *["22,5"] * 6, "1.450", "293,873", "884,225"]],
        ["'1.450' in column X may be 1.450 or 1450"],
    ),
}


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.parametrize("command", ["read", "fit"])
def test_what_two_readings_fit_is_asked(name, command, survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    rows, said = ASKED[name]
    cell, path = put(survey, tmp_path, *(";".join(row) for row in rows))
    out = ("-o", tmp_path / "m.json") if command == "fit" else ()
    done = cli(command, path, "--cell", cell, *out)
    assert done.exit_code == 2 and done.stdout == ""
    assert all(text in done.stderr for text in said), done.stderr


def test_a_list_of_whole_numbers_between_commas_is_asked(survey, tmp_path) -> None:  # type: ignore[no-untyped-def]
    cell, path = put(survey, tmp_path, "P1,1450,848,-293,873,1884,225")
    done = cli("read", path, "--cell", cell, "--program", survey[0] / "s.pdl")
    assert done.exit_code == 2 and "or be decimal commas" in done.stderr


def test_columns_and_units_can_be_chosen(survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    rows = survey[1]
    head = [*HEAD, "X Actual"]
    body = [[*row, "7"] for row in exports.cells(rows, LOCALES["en"])]
    cell, path = put(survey, tmp_path, *(";".join(row) for row in [head, *body]))
    form = tmp_path / "map.toml"
    done = cli("read", path, "--cell", cell, "--column", "x_mm=X", "-o", form)
    assert done.exit_code == 0, done.stderr
    reading = TableFormat(columns=form)
    found = read_measurements(path, cell=load_cell(cell), reading=reading)
    np.testing.assert_allclose(found.position * 1e3, rows.xyz, atol=2e-4)
    done = cli("read", path, "--cell", cell, "--column", "x_mm=U")
    assert done.exit_code == 2 and "column U is missing" in done.stderr
    done = cli("read", path, "--cell", cell, "--column", "x_mm")
    assert done.exit_code == 2 and "write OURS=COLUMN" in done.stderr


def test_the_frame_is_found_by_the_poses(survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    rows = survey[1]
    turned = Rows(rows.ids, rows.q, rows.xyz[:, [1, 0, 2]] * [1, -1, 1] + 3000.0)
    at = LOCALES["en"]
    cell, path = put(survey, tmp_path, exports.sheet(turned, at))
    said = cli("read", path, "--cell", cell).stdout
    assert "frame" in said and "State it: --set measurements.frame=tracker" in said
    set_ = ("--set", "measurements.frame=tracker")
    assert "State it" not in cli("read", path, "--cell", cell, *set_).stdout


def test_files_with_maps_of_their_own(survey, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    rows = survey[1]
    cell, first = put(survey, tmp_path, exports.no_units(rows, LOCALES["en"]))
    second = tmp_path / "u.csv"
    second.write_text(exports.bare_joints(rows, LOCALES["en"]))
    more = ("--cell", cell, "-o", tmp_path / "map.toml")
    done = cli("read", first, second, *more)
    assert done.exit_code == 2 and "Write one for each file" in done.stderr
    third = tmp_path / "v.csv"
    third.write_text(exports.robodk(rows, LOCALES["en"]))
    done = cli("read", third, *more)
    assert done.exit_code == 2 and "needs no column map" in done.stderr
    assert not (tmp_path / "map.toml").exists()


# Workbooks that cannot be read.


def test_a_workbook_without_the_library_names_the_cure(survey, tmp_path, monkeypatch):  # type: ignore[no-untyped-def]
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    path = tmp_path / "t.xlsx"
    path.write_bytes(b"PK\x03\x04")
    done = cli("read", path, "--cell", survey[0] / "cell.toml")
    assert done.exit_code == 2
    assert 'needs openpyxl to be read. Install it (pip install "pos' in done.stderr


def test_workbooks_of_no_use_are_refused_in_our_words(survey, tmp_path) -> None:  # type: ignore[no-untyped-def]
    openpyxl = pytest.importorskip("openpyxl")
    cell = ("--cell", survey[0] / "cell.toml")
    path = tmp_path / "t.xlsx"
    for data, said in (
        (b"PK\x03\x04" + bytes(99), "is no workbook as Excel saves it. Open it"),
        (
            b"\xd0\xcf\x11\xe0" + bytes(99),
            "is a workbook of the old form .xls. Open it",
        ),
    ):
        path.write_bytes(data)
        done = cli("read", path, *cell)
        assert done.exit_code == 2 and said in done.stderr, done.stderr
    book = openpyxl.Workbook()
    for page in (book.active, book.create_sheet("Day 2")):
        for row in [HEAD, *exports.cells(survey[1], LOCALES["en"])]:
            page.append(row)
    book.save(path)
    done = cli("read", path, *cell)
    assert done.exit_code == 2
    assert "sheets 'Sheet', 'Day 2' all hold tables" in done.stderr
    done = cli("read", path, *cell, "--set", "measurements.sheet=Day 2")
    assert done.exit_code == 0 and "sheet 'Day 2'" in done.stdout
    done = cli("read", path, *cell, "--set", "measurements.sheet=Day 3")
    assert done.exit_code == 2 and "has no sheet 'Day 3'" in done.stderr
