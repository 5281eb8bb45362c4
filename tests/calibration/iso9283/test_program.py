"""The program of a test after ISO 9283, read back in every language and run."""

from __future__ import annotations

import json

import numpy as np
import pytest

from postproc.calibration.iso9283.program import find_cube, write_iso_program
from postproc.compensation.program import plan_visits, read_program
from postproc.language.languages import languages
from postproc.robot.cell import load_cell
from tests.any_controller import any_controller
from tests.conftest import ROOT
from tests.written import cli

SUFFIXES = [language.suffixes[0] for language in languages()]


@pytest.fixture(scope="module")
def cell():
    return any_controller(load_cell(ROOT / "programs" / "cell.toml"))


@pytest.fixture(scope="module")
def tests(cell, tmp_path_factory):
    folder = tmp_path_factory.mktemp("iso")
    places = [folder / f"iso{suffix}" for suffix in SUFFIXES]
    for place in places:
        assert "cube of 1000 mm" in write_iso_program(cell, place)
    return places


def test_the_cube_lies_as_the_norm_has_it(cell):
    cube = find_cube(cell)
    tool = np.tile(cell.probes[0], (5, 1))
    at = cell.arm.tcp(cube.joints, tool)
    np.testing.assert_allclose(at, cube.places(), atol=1e-9)
    np.testing.assert_allclose(at[0], at[1:].mean(axis=0), atol=1e-9)
    diagonal = np.sqrt(3) * cube.edge
    for a, b in ((1, 3), (2, 4)):  # a tenth of the diagonal from either end
        assert np.linalg.norm(at[a] - at[b]) == pytest.approx(0.8 * diagonal)
    assert cell.arm.within_limits(cube.joints).all()


def test_every_language_goes_the_same_way(cell, tests):
    planned = []
    for place in tests:
        found = read_program({place.name: place.read_bytes()}, cell)
        assert found.diagnostics == ()
        plan = plan_visits(found.visits, cell)
        assert {reason.text for reason in plan.reasons} <= {""}
        planned.append(
            (found.visits.place.measure_id, plan.plan.q, found.visits.motion.fly)
        )
    ids, q, fly = planned[0]
    for other_ids, other_q, other_fly in planned[1:]:
        assert other_ids == ids
        np.testing.assert_array_equal(other_fly, fly)
        np.testing.assert_allclose(other_q[~fly], q[~fly], atol=1e-6)
        np.testing.assert_allclose(other_q, q, atol=1e-3)


def test_poses_directions_and_cycles(cell, tests):
    place = tests[0]
    visits = read_program({place.name: place.read_bytes()}, cell).visits
    ids = [name for name in visits.place.measure_id if name]
    assert len(ids) == len(set(ids)) == 30 * (5 + 3 * 3)
    assert ids[:6] == ["P5.1", "P4.1", "P3.1", "P2.1", "P1.1", "P5.2"]
    at = {name: i for i, name in enumerate(visits.place.measure_id)}
    for axis, name in enumerate("xyz"):
        row = at[f"P4.{name}.7"]
        q = np.deg2rad(visits.target.values[[row - 1, row], :6])
        came = np.diff(cell.arm.tcp(q, np.tile(cell.probes[0], (2, 1))), axis=0)[0]
        np.testing.assert_allclose(came, 0.05 * np.eye(3)[axis], atol=1e-6)


def test_readings_of_the_virtual_arm_are_judged(desk):
    test, measured = desk.folder / "iso.pdl", desk.folder / "measured.csv"
    given = ("--cell", desk.cell)
    assert cli("survey", *given, "--iso9283", "-o", test).exit_code == 0
    assert cli("simulate", test, *given, "-o", measured).exit_code == 0
    done = cli("iso9283", measured, "--program", test, *given, "--report", "-")
    assert done.exit_code == 0, done.stderr
    values = json.loads(done.stdout)["after"]["values"]
    names = {value["name"] for value in values}
    assert names == {"AP", "RP", "vAP", "AD", "RD"}
    assert all(value["iso"] for value in values)
    tracker = cli(
        "iso9283", measured, "--program", test, *given, "--report", "-",
        "--set", "measurements.frame=tracker",
    )  # fmt: skip
    assert "AP after best fit" in tracker.stdout


def test_a_compensated_program_holds_no_commands(desk):
    test, out = desk.folder / "iso.pdl", desk.folder / "out.pdl"
    given = ("--cell", desk.cell)
    cli("survey", *given, "--iso9283", "-o", test)
    done = cli("compensate", test, *given, "--model", desk.model, "-o", out)
    assert done.exit_code in (0, 1), done.stderr
    points = desk.folder / "points.csv"
    points.write_text("id,x_mm,y_mm,z_mm\nP1.1,1,2,3\n")
    found = cli("iso9283", points, "--program", out, *given)
    assert found.exit_code == 2 and "was compensated" in found.stderr
    points.write_text("id,x_mm,y_mm,z_mm\nP1.99,1,2,3\n")
    found = cli("iso9283", points, "--program", test, *given)
    assert found.exit_code == 2 and "points.csv:2" in found.stderr


def test_a_test_has_poses_of_its_own(desk):
    job = desk.folder / "job.pdl"
    given = ("--cell", desk.cell, "--iso9283", "--job", job)
    done = cli("survey", *given, "-o", desk.folder / "iso.pdl")
    assert done.exit_code == 2 and "each names other poses" in done.stderr
