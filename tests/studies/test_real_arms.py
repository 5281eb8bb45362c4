"""The page of real arms: descriptions, splits, and a drawn set from end to end."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from postproc.exceptions import MeasurementError
from postproc.simulation import VirtualCell, measure_rows, read_rows, virtual_arm
from postproc.simulation.tracker import in_tracker_frame

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "studies"))

from data_sets import SHIPPED, descriptions, read_set  # noqa: E402

SHARED = Path(os.environ.get("POSTPROC_SHARED", ROOT.parent / "shared"))
DRAWN = """name = "Drawn"
arm = "nj220-2.7"
frame = "tracker"
licence = "none"
source = "A virtual arm"
[columns]
id = "pose"
{joints}
x_mm = ["goal_x", {{ column = "miss_x", factor = -1.0 }}]
y_mm = ["goal_y", {{ column = "miss_y", factor = -1.0 }}]
z_mm = ["goal_z", {{ column = "miss_z", factor = -1.0 }}]
[[series]]
name = "one"
file = "one.csv"
[[series]]
name = "two"
file = "two.csv"
[[split]]
fit = "one"
draw = "random"
share = 0.25
seeds = [0, 1]
[[split]]
fit = "one"
draw = "last"
[[split]]
fit = "one"
test = "two"
[[published]]
what = "nothing"
rows = "none"
mean_mm = 0.5
"""


def write_series(path: Path, seed: int, rows: int) -> None:
    """Let a virtual arm measure poses, and write them as targets and differences."""
    rng = np.random.default_rng(seed)
    low, high = (
        np.array([-90, -45, -170, -150, -110, -150]),
        np.array([90, 60, -40, 150, 110, 150]),
    )
    q = rng.uniform(low, high, (rows, 6))
    states = path.with_suffix(".states.csv")
    head = ",".join(f"q{j}_deg" for j in range(1, 7))
    np.savetxt(states, q, "%.6f", ",", header=head, comments="")
    setup = VirtualCell()
    arm = virtual_arm(5, ("geometry", "tool", "backlash"), rows=rows)
    measured = in_tracker_frame(measure_rows(arm, setup, read_rows(states)), arm, setup)
    goal = measured.measured * 1e3 + rng.normal(size=(rows, 3))
    miss = goal - measured.measured * 1e3
    names = ["pose", *(f"j{j}" for j in range(1, 7))]
    names += [f"{what}_{a}" for what in ("goal", "miss") for a in "xyz"]
    table = np.column_stack([np.arange(rows), q, goal, miss])
    np.savetxt(path, table, "%.6f", ",", header=",".join(names), comments="")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a folder with a set that was drawn, and its description."""
    folder = tmp_path_factory.mktemp("drawn")
    write_series(folder / "one.csv", 1, 240)
    write_series(folder / "two.csv", 2, 60)
    joints = "\n".join(f'q{j}_deg = "j{j}"' for j in range(1, 7))
    (folder / "dataset-drawn.toml").write_text(DRAWN.format(joints=joints))
    return folder


def described(folder: Path, tmp_path: Path, old: str, new: str) -> Path:
    """Write a description that differs in a few words."""
    text = (folder / "dataset-drawn.toml").read_text()
    assert old in text
    path = tmp_path / "dataset-other.toml"
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.slow
def test_a_page_comes_from_a_folder_and_a_description(
    drawn: Path, tmp_path: Path
) -> None:
    """A fit of an arm with backlash beats geometry alone, which beats none."""
    out = tmp_path / "page.md"
    study = ROOT / "docs" / "studies" / "real_arms.py"
    done = subprocess.run(
        [sys.executable, study, drawn, "--quick", "--described", tmp_path, "-o", out],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    page = out.read_text()
    names = re.search(r"(?m)^\| rows tested \|(.*)\|$", page)
    assert names is not None
    heads = [n.strip() for n in names[1].split("|")]
    for title in ("one, random 25 %, 2 draws", "one, last 30 %"):
        row = re.search(rf"(?m)^\| Drawn {title} \|(.*)\|$", page)
        assert row is not None, page
        mean = dict(zip(heads, map(float, row[1].split("|")), strict=True))
        assert mean["fit"] < 0.06 < mean["geometry alone"] < mean["registered only"]
    assert "| 120 |" in page and "| 60 |" in page  # both draws, and all of the other
    assert "- nothing: mean 0.5 mm (none)" in page
    assert "UR10" not in page


def test_a_folder_without_a_description_is_told(tmp_path: Path) -> None:
    study = ROOT / "docs" / "studies" / "real_arms.py"
    done = subprocess.run(
        [sys.executable, study, tmp_path],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2 and "no described data" in done.stderr


def test_what_is_fitted_is_never_tested(drawn: Path) -> None:
    found = read_set(drawn / "dataset-drawn.toml", drawn)
    assert found is not None
    random, last, other = found.splits
    for split in (random, last):
        for inside, outside in split.draws:
            assert split.same and not np.intersect1d(inside, outside).size
            assert len(inside) + len(outside) == 240
    assert last.draws[0][1].min() > last.draws[0][0].max()
    assert not other.same and [len(r) for r in other.draws[0]] == [240, 60]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('file = "two.csv"', 'file = "two.csv"\nsha256 = "0"', "another file"),
        ("seeds = [0, 1]", 'seeds = [0, 1]\nrows = ["0", "1"]', "other rows are drawn"),
        ('test = "two"', 'test = "three"', "no series 'three'.*one, two"),
        ('licence = "none"', "", "licence"),
        ('goal_z"', 'goal"', "goal"),
        ('test = "two"', 'test = "one"', "'one' tests itself"),
        ("share = 0.25", "share = 1.0", "share"),
        ('frame = "tracker"', 'frame = "base"', "tool_mm"),
    ],
)
def test_what_is_not_as_described_is_refused(
    drawn: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = described(drawn, tmp_path, old, new)
    with pytest.raises(MeasurementError, match=said):
        read_set(path, drawn)


def test_a_set_that_is_not_there_is_left_out(tmp_path: Path) -> None:
    assert [read_set(*at) for at in descriptions(tmp_path)] == [None, None]


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.toml")), ids=lambda p: p.stem)
def test_the_described_rows_are_those_of_the_data(path: Path) -> None:
    """Hashes of files and rows hold, and registration leaves what an arm can miss."""
    found = read_set(path, SHARED / "data")
    if found is None:
        pytest.skip(f"no data of {path.stem} in {SHARED / 'data'}")
    assert len(found.splits) >= 4
    assert all(split.draws for split in found.splits)
