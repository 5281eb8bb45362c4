"""Files of other tools: RoboDK's table, and what a user says of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.calibration.measurements import Measurements, read_survey_file
from postproc.calibration.tables import TableFormat
from postproc.exceptions import MeasurementError, PostprocError
from tests.calibration.simulator import NJ, PLATE, TOOL, random_arm, random_states

NAMED = [
    *(f"Joint {j}" for j in range(1, 7)),
    *(f"Measured {c}" for c in "XYZWPR"),
    *(f"TCP {c}" for c in "XYZWPR"),
]


def robodk(path: Path, angles: float, header: bool = True, n: int = 12) -> np.ndarray:
    """Write a table as RoboDK does, and return the true orientations."""
    rng = np.random.default_rng(0)
    arm = random_arm(rng)
    states = random_states(n, rng, PLATE[:2])
    pose = arm.pose(states.q, states.direction, states.tool)
    turn = Rotation.from_matrix(pose[:, :3, :3]).as_euler("XYZ") * angles
    tcp = np.hstack([states.tool * 1e3, np.zeros((n, 3))])
    q, xyz = np.rad2deg(states.q), pose[:, :3, 3] * 1e3
    xyz[4] = 0.0  # not measured
    table = np.hstack([q, xyz, turn, tcp])
    lines = [", ".join(NAMED)] if header else []
    lines += [", ".join(f"{v:.6f}" for v in row) for row in table]
    path.write_text("\n".join(lines) + "\n")
    return pose[:, :3, :3]


@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize("angles", [1.0, 180.0 / np.pi])
def test_the_table_of_robodk_is_recognised(
    tmp_path: Path, angles: float, header: bool
) -> None:
    R = robodk(tmp_path / "t.csv", angles, header)
    found = read_survey_file(tmp_path / "t.csv", NJ, TOOL[None])
    assert [d.id for d in found.dropped] == ["5"] and len(found) == 11
    np.testing.assert_allclose(found.states.tool[:2], PLATE[:2], atol=1e-9)
    assert len(np.unique(found.states.tool_id)) == 2
    assert found.rotation is not None
    np.testing.assert_allclose(found.rotation, np.delete(R, 4, axis=0), atol=1e-5)
    assert found.line[0] == (2 if header else 1)


def test_a_table_of_points_only_has_no_orientations(tmp_path: Path) -> None:
    robodk(tmp_path / "t.csv", 0.0)
    assert read_survey_file(tmp_path / "t.csv", NJ, TOOL[None]).rotation is None


def test_our_columns_without_ids_are_no_table_of_robodk(tmp_path: Path) -> None:
    """Of 18 columns they are, too; read by position, sides would be measured points."""
    ours = [f"q{j}_deg" for j in range(1, 7)] + [f"lambda{j}" for j in range(1, 7)]
    ours += ["x_mm", "y_mm", "z_mm", "time_s", "temperature_c", "payload_kg"]
    path = tmp_path / "t.csv"
    path.write_text("\n".join([",".join(ours), *2 * [",".join(["1"] * 18)]]) + "\n")
    with pytest.raises(MeasurementError, match="column id is missing"):
        read_survey_file(path, NJ, TOOL[None])


def plain(path: Path, text: str, encoding: str = "utf-8") -> Path:
    head = "id," + ",".join(f"q{j}_deg" for j in range(1, 7)) + ",x_mm,y_mm,z_mm\n"
    body = "é,1.5,2,3,4,5,6,7.25,8,9\nb,1.5,2,3,4,5,6,7.25,8,9\n"
    cells = (head + body).replace(".", "\0").replace(",", text[0])
    path.write_bytes(cells.replace("\0", text[1]).encode(encoding))
    return path


@pytest.mark.parametrize(
    ("written", "encoding", "said"),
    [
        (";,", "utf-8", TableFormat(delimiter=";", decimal=",")),
        ("|.", "utf-8", TableFormat(delimiter="|")),
        ("\t,", "utf-8", TableFormat(delimiter="tab", decimal=",")),
        (" .", "cp1250", TableFormat(delimiter="space", encoding="cp1250")),
        (",.", "utf-16-le", TableFormat(encoding="utf-16-le")),
    ],
)
def test_what_the_user_says_of_a_file_holds(
    tmp_path: Path, written: str, encoding: str, said: TableFormat
) -> None:
    path = plain(tmp_path / "s.csv", written, encoding)
    found: Measurements = read_survey_file(path, NJ, TOOL[None], reading=said)
    assert found.ids == ("é", "b")
    np.testing.assert_allclose(found.position[0], [7.25e-3, 8e-3, 9e-3])
    assert np.rad2deg(found.states.q[0, 0]) == pytest.approx(1.5)


def test_what_the_user_says_wins_over_what_is_detected(tmp_path: Path) -> None:
    path = plain(tmp_path / "s.csv", ";,")
    with pytest.raises(MeasurementError, match=r"s\.csv:2: '1,5' .* not a number"):
        read_survey_file(path, NJ, TOOL[None], reading=TableFormat(decimal="."))
    latin = plain(tmp_path / "l.csv", ",.", "latin-1")
    with pytest.raises(MeasurementError, match="cannot be decoded as utf-8"):
        read_survey_file(latin, NJ, TOOL[None], reading=TableFormat(encoding="utf-8"))
    with pytest.raises(PostprocError, match=r"write \. or ,"):
        TableFormat(decimal="x")
    with pytest.raises(PostprocError, match="mm, m, inch"):
        TableFormat(unit="feet")


MAPPED = """[columns]
{q}
x_mm = ["xt", {{ column = "xd", factor = -1.0 }}]
y_mm = {{ column = "yt", factor = 1000.0 }}
z_mm = "zt"
"""


def mapped(folder: Path, **other: str) -> tuple[Path, Path]:
    """Write a file of targets and differences, and a map of its columns."""
    text = MAPPED.format(q="\n".join(f'q{j}_deg = "A{j}"' for j in range(1, 7)))
    for old, new in other.items():
        text = text.replace(f'{old} = "zt"', f"{old} = {new}")
    (folder / "map.toml").write_text(text)
    head = ",".join([*(f"A{j}" for j in range(1, 7)), "xt,xd,yt,zt"])
    (folder / "t.csv").write_text(f"{head}\n1,2,3,4,5,6,100.5,-0.25,0.02,7\n")
    return folder / "t.csv", folder / "map.toml"


def test_a_column_may_be_a_sum(tmp_path: Path) -> None:
    path, columns = mapped(tmp_path)
    found = read_survey_file(path, NJ, TOOL[None], reading=TableFormat(columns))
    np.testing.assert_allclose(found.position, [[0.10075, 0.020, 0.007]], atol=1e-15)


@pytest.mark.parametrize("points", [("a", "b"), ("1", "0")])
def test_a_map_keeps_names_of_visits_and_probe_points(
    tmp_path: Path, points: tuple[str, str]
) -> None:
    _, columns = mapped(tmp_path)
    own = 'visit = "Stop"\ntool_id = "Ball"\n'
    columns.write_text(columns.read_text() + own)
    head = ",".join([*(f"A{j}" for j in range(1, 7)), "xt,xd,yt,zt,Stop,Ball"])
    rows = [f"1,2,3,4,5,6,1,2,3,4,v{k},{p}" for k, p in enumerate(points)]
    path = tmp_path / "t.csv"
    path.write_text("\n".join([head, *rows]) + "\n")
    named = {"a": TOOL, "b": TOOL + 1.0}
    known = named if points[0] == "a" else np.stack([TOOL + 1.0, TOOL])
    found = read_survey_file(path, NJ, known, reading=TableFormat(columns))
    assert found.visit is not None and len(set(found.visit.tolist())) == 2
    np.testing.assert_allclose(found.states.tool, [TOOL, TOOL + 1.0])


@pytest.mark.parametrize("wrong", ["[]", "7", '["zt", 7]', '{ column = "zt", x = 1 }'])
def test_an_entry_of_a_map_that_means_nothing_is_refused(
    tmp_path: Path, wrong: str
) -> None:
    path, columns = mapped(tmp_path, z_mm=wrong)
    with pytest.raises(
        MeasurementError, match=r"map\.toml.*list of them @ \$\.columns\.z_mm"
    ):
        read_survey_file(path, NJ, TOOL[None], reading=TableFormat(columns))


def test_every_column_of_a_sum_must_be_there(tmp_path: Path) -> None:
    path, columns = mapped(tmp_path, z_mm='["zt", "zz"]')
    with pytest.raises(MeasurementError, match="zz"):
        read_survey_file(path, NJ, TOOL[None], reading=TableFormat(columns))
