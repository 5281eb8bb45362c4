"""diagnose --path: a track that the virtual tracker read is diagnosed, or refused."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from postproc.files import SCHEMAS
from postproc.model.model import load_model
from tests.calibration.planted import few_parts
from tests.compensation.paths.test_path_error import job
from tests.conftest import SEED
from tests.written import cli

RATE = "simulation.track_rate_hz=100"
LINES = 25  # enough for some on which a joint changes its flank alone
EFFECT, PLANTED = "compliance", "compliance@2=0.8"


@pytest.fixture(scope="module")
def tracked(bench_cell, bench_model, tmp_path_factory):
    """A program that ran on the virtual arm, as it is and with an effect planted."""
    folder = tmp_path_factory.mktemp("tracked")
    shutil.copy(bench_cell.path, folder / "cell.toml")
    bench_model.save(folder / "model.json")
    (folder / "job.pdl").write_bytes(job(LINES).encode())
    at = ("--cell", folder / "cell.toml", "--set", f"simulation.seed={SEED}")
    for name, more in (
        ("plain", ()),
        ("planted", ("--set", f"simulation.effects={PLANTED}")),
    ):
        track = ("--track", folder / f"{name}.csv", "--set", RATE)
        found = cli("simulate", folder / "job.pdl", *at, *track, *more)
        assert found.exit_code == 0, found.output
        assert "on the way" in found.stderr
    return folder


def diagnosed(folder, track, *more):
    given = ("--cell", folder / "cell.toml", "--model", folder / "model.json")
    places = ("-o", folder / "better.json", "--report", folder / "d.json")
    program = ("--program", folder / "job.pdl")
    return cli("diagnose", "--path", folder / track, *program, *given, *places, *more)


@pytest.mark.slow
def test_a_path_confirms_the_flanks_and_lacks_nothing(tracked):
    found = diagnosed(tracked, "plain.csv")
    assert found.exit_code == 0, found.output
    told = json.loads((tracked / "d.json").read_text())
    head = {"schema": "postproc-diagnosis", "version": SCHEMAS["diagnosis"]}
    assert list(told.items())[:2] == list(head.items())
    path = told["path"]
    assert path["stops_missed"] == 0 and path["rate_hz"] == pytest.approx(100)
    assert path["across_mm"]["mean_mm"] < 2.0 * path["scatter_mm"]
    verdicts = {j["joint"]: j["verdict"] for j in path["flanks"]}
    large = {j["joint"] for j in path["flanks"] if j["predicted_mm"] > 0.15}
    assert large and all(verdicts[j] in ("confirmed", "uncertain") for j in large)
    assert "confirmed" in verdicts.values()
    assert (
        told["verdict"] in ("noise", "unexplained") or told["after"]["mean_mm"] < 0.04
    )
    better = json.loads((tracked / "better.json").read_text())
    assert better["history"][-1]["in_motion"] == {
        str(j): v for j, v in verdicts.items()
    }


@pytest.mark.slow
def test_one_run_tells_nothing_of_how_poses_repeat_nor_of_the_rest_of_the_range(
    tracked,
):
    with few_parts():
        diagnosed(tracked, "plain.csv")
    given, better = (load_model(tracked / f"{n}.json") for n in ("model", "better"))
    assert better.noise == given.noise and better.registration == given.registration
    assert better.reading_spread == given.reading_spread
    assert np.all(np.array(better.ranges.lower) <= given.ranges.lower)
    assert np.all(np.array(better.ranges.upper) >= given.ranges.upper)
    assert set(better.ranges.tools) >= set(given.ranges.tools)


@pytest.mark.slow
def test_an_effect_that_nobody_declared_is_found_on_the_way(tracked):
    found = diagnosed(tracked, "planted.csv")
    assert found.exit_code == 0, found.output
    told = json.loads((tracked / "d.json").read_text())
    assert told["verdict"] == "effect"
    assert told["path"]["rows_on_the_way"] > 300
    assert EFFECT in [f["effect"] for f in told["effects"]]
    assert told["after"]["mean_mm"] < 0.6 * told["before"]["mean_mm"]


def test_what_is_no_track_of_this_program_is_refused(tracked, tmp_path):
    rows = (tracked / "plain.csv").read_text().splitlines()
    cases = {
        "short.csv": (rows[:20], "19 readings"),
        "names.csv": (["t,x,y,z", *rows[1:]], "time_s"),
        "back.csv": ([*rows[:300], rows[2], *rows[300:]], "301"),
        "slow.csv": (rows[:1] + [f"{k},0,0,0" for k in range(200)], "20 to 2000"),
        "away.csv": (
            [rows[0], *(",".join([r.split(",")[0], "1", "2", "3"]) for r in rows[1:])],
            "stops were found",
        ),
    }
    for name, (lines, said) in cases.items():
        (tracked / name).write_text("\n".join(lines) + "\n")
        found = diagnosed(tracked, name)
        assert found.exit_code == 2 and said in found.stderr.replace("\n", " "), name
    found = diagnosed(tracked, "plain.csv", "--set", "measurements.frame=tracker")
    assert found.exit_code == 2 and "where the tracker stood" in found.stderr


def test_measurements_or_a_path(tracked):
    given = ("--cell", tracked / "cell.toml", "--model", tracked / "model.json")
    assert "--path" in cli("diagnose", *given).stderr
    found = cli("diagnose", "--path", tracked / "plain.csv", *given)
    assert found.exit_code == 2 and "--program" in found.stderr
