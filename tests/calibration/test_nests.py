"""Nests have names or numbers, one numbering, and arms have six axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.calibration.survey_files import read_measurements
from postproc.exceptions import CellError, MeasurementError
from postproc.robot.cell import load_cell
from tests.calibration.simulator import NJ, PLATE

JOINTS = ",".join(f"q{j}_deg" for j in range(1, 7))
NAMED = dict(zip(("left", "right", "top"), PLATE, strict=True))
POINTS = {name: (xyz * 1e3).tolist() for name, xyz in NAMED.items()}


def written(
    path: Path, ids: list[str], column: str = "tool_id", more: str = ""
) -> Path:
    lines = [f"id,{JOINTS},x_mm,y_mm,z_mm,{column}{more and ',' + more}"]
    for k, one in enumerate(ids):
        extra = "".join(",7" for _ in more.split(",") if more)
        lines.append(f"M{k},{k},-{k},9,8,7,6,1000,{k},3,{one}{extra}")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("ids", "points"),
    [
        (["0", "1", "2"], [0, 1, 2]),
        (["1", "2", "3"], [0, 1, 2]),
        (["0", "1"], [0, 1]),
        (["3", "1"], [2, 0]),
        (["0", "0"], [0, 0]),
    ],
)
def test_numbers_count_from_zero_or_clearly_from_one(
    tmp_path: Path, ids: list[str], points: list[int]
) -> None:
    found = read_survey_file(written(tmp_path / "s.csv", ids), NJ, PLATE)
    np.testing.assert_allclose(found.states.tool, PLATE[points])


@pytest.mark.parametrize("ids", [["1", "2"], ["1", "1"], ["2", "2"], ["1"], ["2", "1"]])
def test_numbers_that_mean_two_points_are_refused(
    tmp_path: Path, ids: list[str]
) -> None:
    path = written(tmp_path / "s.csv", ids)
    with pytest.raises(MeasurementError, match=r"from 0, which .* or from 1") as e:
        read_survey_file(path, NJ, PLATE)
    assert "[survey.points]" in str(e.value) and str(path) in str(e.value)
    one = read_survey_file(written(tmp_path / "o.csv", ["1"]), NJ, PLATE[:1])
    np.testing.assert_allclose(one.states.tool, PLATE[:1])
    own = written(tmp_path / "t.csv", ids, more="tool_x_mm,tool_y_mm,tool_z_mm")
    assert read_survey_file(own, NJ, PLATE).states.tool[0, 0] == pytest.approx(7e-3)


@pytest.mark.parametrize("column", ["tool_id", "nest"])
@pytest.mark.parametrize(
    "ids", [["left", "top"], ["LEFT", " top "], ["left", "top", "right", "left"]]
)
def test_names_are_those_of_the_cell(
    tmp_path: Path, ids: list[str], column: str
) -> None:
    found = read_survey_file(written(tmp_path / "s.csv", ids, column), NJ, NAMED)
    expected = [NAMED[i.strip().lower()] for i in ids]
    np.testing.assert_allclose(found.states.tool, expected)
    numbers = [list(NAMED).index(i.strip().lower()) for i in ids]
    assert found.states.tool_id.tolist() == numbers


def test_names_that_are_numbers_are_names(tmp_path: Path) -> None:
    known = {"1": PLATE[0], "2": PLATE[1], "3": PLATE[2]}
    found = read_survey_file(written(tmp_path / "s.csv", ["1", "2"]), NJ, known)
    np.testing.assert_allclose(found.states.tool, PLATE[:2])


def test_numbers_beside_points_of_their_own_are_kept(tmp_path: Path) -> None:
    """The virtual arm writes them so."""
    own = written(tmp_path / "t.csv", ["0", "2"], more="tool_x_mm,tool_y_mm,tool_z_mm")
    found = read_survey_file(own, NJ, NAMED)
    assert found.states.tool_id.tolist() == [0, 2]
    assert found.states.tool[0, 0] == pytest.approx(7e-3)


def test_what_the_cell_does_not_name_is_refused(tmp_path: Path) -> None:
    def refused(match: str, path: Path, tools: object = NAMED) -> None:
        with pytest.raises(MeasurementError, match=match):
            read_survey_file(path, NJ, tools)  # type: ignore[arg-type]

    refused("nest 'lft' is not one of", written(tmp_path / "a.csv", ["lft"], "nest"))
    refused("tool_id '1' is not one of", written(tmp_path / "b.csv", ["1"]))
    refused("'left' is not one of .*none", written(tmp_path / "c.csv", ["left"]), PLATE)
    refused("has no column nest", written(tmp_path / "d.csv", ["1"], "speed_mm_s"))
    both = written(tmp_path / "e.csv", ["left"], "nest", "tool_id")
    refused("columns nest and tool_id", both)


@pytest.mark.parametrize("known", [NAMED, PLATE])
@pytest.mark.parametrize("ids", [["left", "", "top"], ["0", "", "2"]])
def test_a_row_without_a_name_is_refused_by_its_line(
    tmp_path: Path, ids: list[str], known: object
) -> None:
    path = written(tmp_path / "s.csv", ids)
    with pytest.raises(MeasurementError, match=r"s\.csv:3: has no tool_id"):
        read_survey_file(path, NJ, known)  # type: ignore[arg-type]


def survey(tmp_path: Path, section: str, ids: list[str]) -> Measurements:
    cell = tmp_path / "cell.toml"
    cell.write_text(f'[robot]\narm = "nj220-2.7"\n{section}\n')
    return read_measurements(written(tmp_path / "s.csv", ids), cell=load_cell(cell))


def test_a_cell_names_its_points(tmp_path: Path) -> None:
    lines = "\n".join(f"{name} = {xyz}" for name, xyz in POINTS.items())
    found = survey(tmp_path, "[survey.points]\n" + lines, ["top", "left"])
    np.testing.assert_allclose(found.states.tool, PLATE[[2, 0]])
    numbered = f"[survey]\npoints_mm = {list(POINTS.values())}"
    np.testing.assert_allclose(
        survey(tmp_path, numbered, ["2", "0"]).states.tool, PLATE[[2, 0]]
    )
    with pytest.raises(CellError, match="points_mm and points"):
        survey(tmp_path, numbered + "\n[survey.points]\n" + lines, ["2"])
    with pytest.raises(CellError, match="has no points"):
        survey(tmp_path, "[survey]\n", ["2"])


@pytest.mark.parametrize(
    ("count", "cure"),
    [(7, "keep one joint locked"), (8, "locked"), (5, "lacks"), (4, "lacks")],
)
def test_other_numbers_of_axes_have_one_message(
    tmp_path: Path, count: int, cure: str
) -> None:
    names = [f"q{j}_deg" for j in range(1, count + 1)]
    path = tmp_path / "s.csv"
    cells = ",".join(["1"] * (count + 3))
    path.write_text(",".join(["id", *names, "x_mm,y_mm,z_mm"]) + f"\nM0,{cells}\n")
    with pytest.raises(MeasurementError, match=f"has {count} joint columns") as e:
        read_survey_file(path, NJ, PLATE)
    assert cure in str(e.value)
