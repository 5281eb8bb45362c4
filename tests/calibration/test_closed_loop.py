"""The loop closed by the command line: points of a job, the effect, a better job.

A model that knows nothing of gravity compensates a job; points of the compensated job
are measured on the virtual arm; the diagnosis finds what the model lacks; the extended
model compensates the job anew.
"""

from __future__ import annotations

import csv
import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from postproc.robot.pose import pose_from_record
from tests.slow import slow
from tests.written import cli

CELL = """
[robot]
arm = "nj220-2.7"
[tool]
xyz_mm = [100.0, 50.0, 200.0]
source = "tracker"
[uframe]
xyz_mm = [150.0, -80.0, 120.0]
euler_zyz_deg = [12.0, 0.0, 0.0]
source = "tracker"
[payload]
mass_kg = 90.0
com_mm = [0.0, 0.0, 200.0]
[tracker]
xyz_mm = [3000.0, -2000.0, 1500.0]
[survey]
points_mm = [[-212.5, 96.0, 331.0], [148.0, -121.5, 268.0], [-58.0, 42.5, 514.0]]
"""
UFRAME = pose_from_record((150.0, -80.0, 120.0, 12.0, 0.0, 0.0))
ARM = ("--set", "simulation.seed=7", "--set", "simulation.effects=compliance@2=0.8")
START = "MOVE JOINT TO {0.0, 0.0, -90.0, 0.0, 60.0, 0.0}"


def job() -> str:
    """Write a job: 48 places all over the front of the arm, each one marked."""
    rng = np.random.default_rng(5)
    lines = ["PROGRAM job", "BEGIN", f"  {START}"]
    grid = product((1300, 1600, 1900, 2200), (-900, -300, 300, 900), (600, 1100, 1600))
    for k, place in enumerate(grid):
        x, y, z = np.array(place) + rng.uniform(-90, 90, 3) - (150, -80, 120)
        a = np.degrees(np.arctan2(y, x)) + rng.uniform(-30, 30)
        e, r = rng.uniform(110, 165), rng.uniform(-60, 60)
        numbers = ", ".join(f"{v:.3f}" for v in (x, y, z, a, e, r))
        lines.append(f"  MOVE JOINT TO POS({numbers}, '')  -- MEASURE h{k + 1}")
    return "\r\n".join([*lines, "END job", ""])


def done(*arguments: object) -> None:
    found = cli(*arguments)
    assert found.exit_code == 0, found.stderr


def true_error(folder: Path, program: str) -> float:
    """Return where the tool lands, against the job as it was written: mean [mm]."""
    told = folder / "true.json"
    done("simulate", folder / program, "--cell", folder / "cell.toml", *ARM,
         "--reference", folder / "job.pdl", "--report", told)  # fmt: skip
    return float(json.loads(told.read_bytes())["true_error"]["mean_mm"])


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A job compensated with a model that lacks the compliance, and its points."""
    folder = tmp_path_factory.mktemp("loop")
    (folder / "cell.toml").write_text(CELL)
    (folder / "job.pdl").write_text(job(), newline="")
    cell = ("--cell", folder / "cell.toml")
    done("survey", *cell, "--poses", "80", "-o", folder / "survey.pdl")
    done("simulate", folder / "survey.pdl", *cell, *ARM, "-o", folder / "survey.csv")
    done("fit", folder / "survey.csv", *cell, "-o", folder / "model.json",
         "--effects", "geometry,backlash")  # fmt: skip
    done("compensate", folder / "job.pdl", *cell, "--model", folder / "model.json",
         "-o", folder / "out.pdl")  # fmt: skip
    done("simulate", folder / "out.pdl", *cell, *ARM, "-o", folder / "rows.csv")
    return folder


def points(folder: Path, name: str, into: np.ndarray) -> Path:
    """Write what a tracker tells of the job: id and position in some frame."""
    with (folder / "rows.csv").open(newline="") as file:
        rows = [r for r in csv.DictReader(file) if r["id"].startswith("h")]
    assert len(rows) == 48
    xyz = np.array([[float(r[k]) for k in ("x_mm", "y_mm", "z_mm")] for r in rows])
    there = xyz @ into[:3, :3].T + into[:3, 3] * 1e3
    lines = [
        f"{r['id']}," + ",".join(f"{v:.4f}" for v in p)
        for r, p in zip(rows, there, strict=True)
    ]
    path = folder / name
    path.write_text("\n".join(["id,x_mm,y_mm,z_mm", *lines, ""]))
    return path


FRAMES = {
    "base": np.eye(4),
    "uframe": np.linalg.inv(UFRAME),
    "tracker": np.linalg.inv(pose_from_record((3000, -2000, 1500, 40.0, 3.0, 80.0))),
}


@pytest.mark.parametrize("frame", ["base", *slow(["uframe", "tracker"])])
def test_points_of_a_job_find_the_effect_and_mend_the_job(
    shop: Path, frame: str
) -> None:
    cell = ("--cell", shop / "cell.toml")
    better = shop / f"better-{frame}.json"
    found = cli(
        "diagnose", points(shop, f"{frame}.csv", FRAMES[frame]), *cell,
        "--model", shop / "model.json", "--program", shop / "out.pdl",
        "--set", f"measurements.frame={frame}", "-o", better,
        "--report", shop / "found.json",
    )  # fmt: skip
    assert found.exit_code == 0, found.stderr
    report = json.loads((shop / "found.json").read_bytes())
    named = {(e["effect"], e["joint"]) for e in report["effects"]}
    named |= {(g["effect"], g["joint"]) for e in report["effects"]
              for g in e["confusable_with"]}  # fmt: skip
    assert ("compliance", 2) in named
    assert report["after"]["mean_mm"] < 0.7 * report["before"]["mean_mm"]
    assert report["after"]["mean_mm"] < 1.3 * report["noise_floor_mm"]

    done("compensate", shop / "job.pdl", *cell, "--model", better,
         "-o", shop / f"again-{frame}.pdl")  # fmt: skip
    after, before = (true_error(shop, f) for f in (f"again-{frame}.pdl", "out.pdl"))
    assert after < 0.4 * before
    told = cli("history", better)
    assert "compliance of joint 2" in told.stdout


def test_a_job_cannot_be_diagnosed_with_points_of_another(shop: Path) -> None:
    other = shop / "other.csv"
    other.write_text("id,x_mm,y_mm,z_mm\nh1,1500,0,1000\nk7,1,2,3\n")
    found = cli("diagnose", other, "--cell", shop / "cell.toml", "--model",
                shop / "model.json", "--program", shop / "out.pdl")  # fmt: skip
    assert found.exit_code == 2
    assert "other.csv:3: id k7 has no visit in the program" in found.stderr
    assert not (shop / "model.extended.json").exists()
