from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.measurements import concatenate, read_survey_file
from postproc.calibration.survey_checks import check_survey
from postproc.exceptions import MeasurementError
from tests.calibration.simulator import NJ, PLATE, TOOL, random_states

HEADER = "id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
SIDES = ",lambda1,lambda2,lambda3,lambda4,lambda5,lambda6"


def rows(n: int = 30, seed: int = 0, **change: float) -> list[str]:
    """Rows of nominal positions."""
    states = random_states(n, np.random.default_rng(seed), TOOL[None])
    T = NJ.flange(states.q)
    tcp = T[:, :3, 3] + T[:, :3, :3] @ TOOL
    cells = [
        [k + 1, *np.rad2deg(states.q[k]), *states.direction[k].astype(int),
         *(tcp[k] * change.get("length", 1e3))]
        for k in range(n)
    ]  # fmt: skip
    return [",".join(f"{c:.6g}" if isinstance(c, float) else str(c) for c in row)
            for row in cells]  # fmt: skip


def write(path: Path, lines: list[str], header: str = "") -> Path:
    head = header or HEADER + SIDES + ",x_mm,y_mm,z_mm"
    path.write_text("\n".join([head, *lines]) + "\n")
    return path


def test_a_file_is_read_in_si_units(tmp_path: Path) -> None:
    path = write(tmp_path / "s.csv", rows())
    found = read_survey_file(path, NJ, TOOL[None])
    states = random_states(30, np.random.default_rng(0), TOOL[None])
    np.testing.assert_allclose(found.states.q, states.q, atol=1e-5)
    np.testing.assert_array_equal(found.states.direction, states.direction)
    np.testing.assert_allclose(found.states.tool, states.tool)
    assert found.line[0] == 2 and found.ids[0] == "1"
    assert not found.inferred.any() and not found.warnings


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_semicolons_commas_and_encodings_are_detected(
    tmp_path: Path, encoding: str
) -> None:
    plain = write(tmp_path / "a.csv", rows()).read_text()
    other = plain.replace(",", ";").replace(".", ",").replace("\n", "\r\n")
    path = tmp_path / "b.csv"
    path.write_bytes(other.encode(encoding))
    a = read_survey_file(tmp_path / "a.csv", NJ, TOOL[None])
    b = read_survey_file(path, NJ, TOOL[None])
    np.testing.assert_array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.states.q, b.states.q)


def test_directions_are_inferred_where_they_are_missing(tmp_path: Path) -> None:
    header = HEADER + ",x_mm,y_mm,z_mm"
    lines = [
        f"{k},{10 * k},{-5 * k},-90,0,30,{5 if k == 1 else 0},1,2,3" for k in range(3)
    ]
    found = read_survey_file(write(tmp_path / "s.csv", lines, header), NJ, TOOL[None])
    assert found.inferred.all() and "sorted" in found.warnings[0]
    assert found.states.direction[0].tolist() == [0] * 6
    assert found.states.direction[1].tolist() == [1, -1, 0, 0, 0, 1]
    assert found.states.direction[2].tolist() == [1, -1, 0, 0, 0, -1]


def test_travels_are_inferred_where_the_sides_are_those_of_straight_ways(
    tmp_path: Path,
) -> None:
    told = rows()
    bare = [",".join(c for k, c in enumerate(r.split(",")) if not 7 <= k < 13)
            for r in told]  # fmt: skip
    path = write(tmp_path / "bare.csv", bare, HEADER + ",x_mm,y_mm,z_mm")
    straight = read_survey_file(path, NJ, TOOL[None]).states
    assert np.isfinite(straight.travel).all()

    def with_sides(sides: np.ndarray) -> np.ndarray:
        cells = [",".join([*r.split(",")[:7], *map(str, s), *r.split(",")[13:]])
                 for r, s in zip(told, sides.astype(int), strict=True)]  # fmt: skip
        path = write(tmp_path / "sides.csv", cells)
        return read_survey_file(path, NJ, TOOL[None]).states.travel

    np.testing.assert_array_equal(with_sides(straight.direction), straight.travel)
    once = straight.direction.copy()
    once[5, 2] *= -1  # one row came another way
    other = once != straight.direction
    assert np.isnan(with_sides(once)[other]).all()
    assert np.isfinite(with_sides(once)[~other]).all()
    assert np.isnan(with_sides(-straight.direction)).all()  # by way of other points


def test_lost_beams_are_dropped_and_listed(tmp_path: Path) -> None:
    lines = rows()
    lines[4] = ",".join([*lines[4].split(",")[:13], "0", "0", "0"])
    found = read_survey_file(write(tmp_path / "s.csv", lines), NJ, TOOL[None])
    assert len(found) == 29
    assert [(d.id, d.line) for d in found.dropped] == [("5", 6)]
    assert "beam" in found.dropped[0].why


def spoiled(place: int, cell: int, text: str) -> list[str]:
    lines = rows()
    cells = lines[place].split(",")
    cells[cell] = text
    lines[place] = ",".join(cells)
    return lines


@pytest.mark.parametrize(
    ("lines", "line", "match"),
    [
        (spoiled(3, 13, "NaN"), 5, "'NaN' in column x_mm is not a number"),
        (spoiled(3, 2, ""), 5, "'' in column q2_deg is not a number"),
        (spoiled(3, 8, "2"), 5, "wrong lambda"),
    ],
)
def test_wrong_cells_are_named(
    tmp_path: Path, lines: list[str], line: int, match: str
) -> None:
    with pytest.raises(MeasurementError, match=match) as caught:
        read_survey_file(write(tmp_path / "s.csv", lines), NJ, TOOL[None])
    assert caught.value.line == line and caught.value.cure


def test_wrong_files_are_named(tmp_path: Path) -> None:
    def refused(match: str, path: Path) -> None:
        with pytest.raises(MeasurementError, match=match):
            read_survey_file(path, NJ, TOOL[None])

    refused("cannot be read", tmp_path / "none.csv")
    (tmp_path / "empty.csv").write_text("")
    refused("no measurements", tmp_path / "empty.csv")
    (tmp_path / "b.csv").write_bytes(b"\x01\x02\x03\0\0\0")
    refused("not a text file", tmp_path / "b.csv")
    header = HEADER + SIDES + ",x_mm,y_mm"
    refused("column z_mm is missing", write(tmp_path / "c.csv", ["1,2"], header))
    short = [*rows(), "31,1,2"]
    with pytest.raises(MeasurementError):
        read_survey_file(write(tmp_path / "d.csv", short), NJ, TOOL[None])
    twice = HEADER + ",q1_deg"
    refused("'q1_deg' appears twice", write(tmp_path / "e.csv", ["1,2"], twice))


def test_probe_points_by_id_or_by_columns(tmp_path: Path) -> None:
    header = HEADER + SIDES + ",x_mm,y_mm,z_mm,tool_id"
    lines = [f"{line},{k % 3}" for k, line in enumerate(rows())]
    path = write(tmp_path / "s.csv", lines, header)
    found = read_survey_file(path, NJ, PLATE)
    np.testing.assert_allclose(found.states.tool[:3], PLATE)
    with pytest.raises(MeasurementError, match="tool_id 2 is not one of") as caught:
        read_survey_file(path, NJ, PLATE[:2])
    assert caught.value.line == 4
    more = header.replace("tool_id", "tool_x_mm,tool_y_mm,tool_z_mm")
    own = write(tmp_path / "t.csv", [f"{line},1,2,3" for line in rows()], more)
    found = read_survey_file(own, NJ, PLATE)
    np.testing.assert_allclose(found.states.tool[0], [1e-3, 2e-3, 3e-3])


def test_files_follow_each_other(tmp_path: Path) -> None:
    a = read_survey_file(write(tmp_path / "a.csv", rows()), NJ, TOOL[None])
    later = [f"b{line}" for line in rows(seed=1)]
    b = read_survey_file(write(tmp_path / "b.csv", later), NJ, TOOL[None])
    both = concatenate([a, b])
    assert len(both) == 60 and both.states.order[-1] == 59
    with pytest.raises(MeasurementError, match=r"c\.csv: holds the rows of .*a\.csv"):
        again = read_survey_file(write(tmp_path / "c.csv", rows()), NJ, TOOL[None])
        concatenate([a, again])


def test_ids_that_repeat_are_named_with_line_or_file(tmp_path: Path) -> None:
    a = read_survey_file(write(tmp_path / "a.csv", spoiled(3, 0, "2")), NJ, TOOL[None])
    assert a.ids[1:4] == ("2", "3", "2 (line 5)")
    b = read_survey_file(write(tmp_path / "b.csv", rows(seed=1)), NJ, TOOL[None])
    assert concatenate([a, b]).ids[30:32] == ("1 of b.csv", "2 of b.csv")


@pytest.mark.parametrize("name", ["q{}_rad", "Q{} [rad]", "q{} (rad)", "q{} rad"])
def test_joint_angles_whose_header_says_radians_are_converted(
    tmp_path: Path, name: str
) -> None:
    header, lines = HEADER + SIDES + ",x_mm,y_mm,z_mm", []
    for j in range(1, 7):
        header = header.replace(f"q{j}_deg", name.format(j))
    first = HEADER.split(",").index("q1_deg")
    for line in rows():
        cells = line.split(",")
        for k in range(first, first + 6):
            cells[k] = repr(float(np.deg2rad(float(cells[k]))))
        lines.append(",".join(cells))
    found = read_survey_file(write(tmp_path / "r.csv", lines, header), NJ, TOOL[None])
    there = read_survey_file(write(tmp_path / "d.csv", rows()), NJ, TOOL[None])
    np.testing.assert_allclose(found.states.q, there.states.q, rtol=0, atol=1e-14)


def test_implausible_surveys_are_refused_with_the_reason(tmp_path: Path) -> None:
    def refused(match: str, lines: list[str]) -> None:
        survey = read_survey_file(write(tmp_path / "s.csv", lines), NJ, TOOL[None])
        with pytest.raises(MeasurementError, match=match):
            check_survey(survey, NJ)

    check_survey(
        read_survey_file(write(tmp_path / "ok.csv", rows()), NJ, TOOL[None]), NJ
    )
    refused("look like metres", rows(length=1.0))
    radians = []
    for row in rows():
        cells = row.split(",")
        cells[1:7] = [f"{np.deg2rad(float(c)):.8f}" for c in cells[1:7]]
        radians.append(",".join(cells))
    refused("look like radians", radians)
    far = []
    for row in rows():
        cells = row.split(",")
        x, y, z = map(float, cells[-3:])
        far.append(",".join([*cells[:-3], f"{-y + 3000}", f"{x}", f"{z - 500}"]))
    refused("use --set measurements.frame=tracker", far)
    refused("determine", rows()[:5])
    refused("determine", [f"{k}," + rows()[0].split(",", 1)[1] for k in range(40)])
