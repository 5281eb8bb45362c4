"""The survey program: every pose from both sides, its readings joined by their ids."""

from __future__ import annotations

import re

import numpy as np
import pytest

from postproc.calibration.survey_program import BACK, STEPS, write_survey
from postproc.compensation.program import plan_visits, read_program
from postproc.robot.cell import load_cell
from tests.written import cli, program

POSES = 24


@pytest.fixture(scope="module")
def survey(job_folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("survey") / "s.pdl"
    told = write_survey(job_folder / "cell.toml", path, POSES)
    assert told.startswith(f"{path}: {POSES} poses")
    return path


@pytest.fixture(scope="module")
def visits(survey, job_cell):
    return read_program({survey.name: survey.read_bytes()}, job_cell).visits


def test_every_pose_is_measured_twice_under_its_own_id(visits):
    ids = [name for name in visits.place.measure_id if name]
    assert len(ids) == len(set(ids)) == 2 * POSES
    assert set(ids) == {f"{k + 1}{side}" for k in range(POSES) for side in "ab"}


def test_both_arrivals_at_a_pose_come_from_opposite_sides(visits, job_cell):
    planned = plan_visits(visits, job_cell)
    at = {name: i for i, name in enumerate(visits.place.measure_id) if name}
    for k in range(POSES):
        a, b = at[f"{k + 1}a"], at[f"{k + 1}b"]
        np.testing.assert_array_equal(visits.target.values[a], visits.target.values[b])
        sides = planned.plan.direction[[a, b]]
        assert (np.abs(sides) == 1).all() and (sides[0] == -sides[1]).all()
        way = np.abs(visits.target.values[a] - visits.target.values[a - 1])
        np.testing.assert_allclose(way, np.rad2deg(BACK), atol=2e-5)
    assert not np.isnan(planned.plan.q).any()
    told = {planned.reasons[i].text for i in range(len(visits))} - {""}
    assert all("wrist singularity" in text for text in told)  # harmless to measure at


def test_every_probe_point_is_used_and_mounted_once(survey, visits, job_cell):
    mounted = re.findall(r"\$TOOL := POS\(([^)]*), 0, 0, 0, ''\)", survey.read_text())
    xyz = np.array([[float(v) for v in text.split(",")] for text in mounted])
    np.testing.assert_allclose(xyz, job_cell.probes * 1e3, atol=1e-3)
    used = [
        visits.frame.tool[i] for i, name in enumerate(visits.place.measure_id) if name
    ]
    assert (np.bincount(used)[np.unique(used)] == 2 * POSES / len(xyz)).all()


def test_same_seed_same_survey(job_folder, survey, tmp_path):
    again, other = tmp_path / "s.pdl", tmp_path / "other" / "s.pdl"
    other.parent.mkdir()
    write_survey(job_folder / "cell.toml", again, POSES)
    write_survey(
        load_cell(job_folder / "cell.toml", changes=["survey.seed=1"]), other, POSES
    )
    assert again.read_bytes() == survey.read_bytes() != other.read_bytes()


def test_reversals_turn_one_drive_back_from_where_all_came(
    job_folder, job_cell, tmp_path
):
    path = tmp_path / "s.pdl"
    write_survey(
        load_cell(job_folder / "cell.toml", changes=["survey.reversals=2"]), path, POSES
    )
    visits = read_program({path.name: path.read_bytes()}, job_cell).visits
    first = path.read_text().splitlines()[0]
    many, measured = map(int, re.findall(r"and (\d+) reversals: (\d+) meas", first)[0])
    assert (
        measured
        == 2 * POSES + (1 + len(STEPS)) * many
        == sum(map(bool, visits.place.measure_id))
    )
    steps = [
        (i, *map(int, name.split(".")))
        for i, name in enumerate(visits.place.measure_id)
        if "." in name
    ]
    assert {drive for _, _, drive, _ in steps} == set(range(1, 7))
    drives = visits.target.values @ job_cell.arm.coupling.T
    for i, pose, drive, k in steps:
        if not k:
            begin, came = i, drives[i] - drives[i - 1]
            assert (np.abs(came) > np.rad2deg(BACK) / 2).all()
            known = visits.place.measure_id.index(f"{pose}a")
            np.testing.assert_array_equal(
                visits.target.values[i], visits.target.values[known]
            )
            continue
        turned = np.deg2rad(drives[i] - drives[begin])
        assert turned[drive - 1] * came[drive - 1] < 0
        np.testing.assert_allclose(abs(turned[drive - 1]), STEPS[k - 1], atol=1e-6)
        assert (np.abs(np.delete(turned, drive - 1)) < 1e-6).all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--poses", "0"), "0 poses are no survey"),
        (("--set", "survey.mode=both"), "'lhs', 'optimal' or 'd-optimal' @ $.mode"),
        (("--set", "tracker.xyz_mm=[1,2]"), "$.xyz_mm"),
        (
            ("--poses", "11", "--set", "survey.reversals=4"),
            "need 16 poses, and there are 11",
        ),
    ],
)
def test_wrong_options(desk, options, said):
    found = cli("survey", "--cell", desk.cell, "-o", desk.folder / "s.pdl", *options)
    assert found.exit_code == 2 and said in found.stderr
    assert desk.names() == set()


def test_the_volume_of_a_job_is_surveyed(desk):
    moves = (f"MOVE JOINT TO {{{q}.0, 20.0, -85.0, 30.0, 60.0, 45.0}}" for q in (5, 25))
    job, out = desk.put("job.pdl", program(*moves)), desk.folder / "near.pdl"
    options = ("--cell", desk.cell, "--poses", 12, "-o", out)
    found = cli("survey", *options, "--job", job)
    assert found.exit_code == 0, found.stderr
    assert "12 poses (round the program's arrivals)" in found.stderr
    assert out.read_text("latin-1").count("MEASURE ") == 25
    empty = desk.put("empty.pdl", "PROGRAM empty\nBEGIN\nEND empty\n")
    refused = cli("survey", *options, "--job", empty)
    assert refused.exit_code == 2
    assert "empty.pdl: has no arrival that can be planned" in refused.stderr
