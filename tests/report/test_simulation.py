"""The virtual arm runs programs and surveys, and measures them."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from postproc.calibration.fit import fit
from postproc.calibration.survey_program import write_survey
from postproc.language.languages import language_of_text
from postproc.report.simulation import chain_of, setup_of, simulate_file, visits_of
from postproc.robot.arm_file import arm_path, list_shipped_arms, read_arm_file
from postproc.robot.cell import load_cell
from postproc.simulation import NJ220, land, virtual_arm
from tests.conftest import SEED
from tests.written import FIRST, NEXT, POSE, cli, program


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def positions(path):
    return np.array([[float(r[k]) for k in ("x_mm", "y_mm", "z_mm")]
                     for r in rows_of(path)])  # fmt: skip


def test_measured_visits_carry_their_ids(desk):
    marked = ("-- MEASURE hole_1", POSE, NEXT, "-- MEASURE hole_2", FIRST)
    source, out = desk.put("job.pdl", program(FIRST, *marked)), desk.folder / "m.csv"
    found = cli("simulate", source, "--cell", desk.cell, "-o", out)
    assert found.exit_code == 0
    assert [r["id"] for r in rows_of(out)] == ["hole_1", "hole_2"]


def test_an_id_is_no_formula_of_a_spreadsheet(desk):
    marked = ("-- MEASURE =HYPERLINK(1)", POSE, "-- MEASURE @SUM(1)", FIRST)
    source, out = desk.put("job.pdl", program(FIRST, *marked)), desk.folder / "m.csv"
    assert cli("simulate", source, "--cell", desk.cell, "-o", out).exit_code == 0
    assert [r["id"] for r in rows_of(out)] == ["'=HYPERLINK(1)", "'@SUM(1)"]


def test_a_seed_is_an_arm(desk):
    source = desk.put("job.pdl", program(FIRST, POSE))
    made = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        path = desk.folder / name
        simulate_file(source, desk.cell, seed).write(path)
        made.append(positions(path))
    np.testing.assert_array_equal(made[0], made[1])
    assert (np.linalg.norm(made[0] - made[2], axis=1) > 0.1).all()


def test_readings_are_the_landing_with_a_trackers_noise(desk, job_cell):
    source, out = desk.put("job.pdl", program(*[FIRST, POSE, NEXT] * 20)), None
    out = desk.folder / "m.csv"
    found = simulate_file(source, desk.cell, SEED, reference=source)
    found.write(out)
    landed = land(
        virtual_arm(SEED, tool=job_cell.tool.pose),
        setup_of(job_cell),
        visits_of(source, job_cell),
    ).landed
    noise = positions(out) - landed * 1e3
    assert 0.005 < noise.std() < 0.06 and abs(noise.mean()) < 0.02


def test_a_compensated_program_misses_less(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT, POSE, NEXT))
    out = desk.folder / "out.pdl"
    desk.compensate(source, "-o", out)
    errors = [
        json.loads(
            cli("simulate", p, "--cell", desk.cell, "--set", f"simulation.seed={SEED}",
                "--reference", source, "--report", "-").stdout
        )["true_error"]
        for p in (source, out)
    ]  # fmt: skip
    assert errors[0]["n"] == errors[1]["n"] == 5
    assert errors[1]["mean_mm"] < 0.2 * errors[0]["mean_mm"]


def test_a_program_may_be_its_own_reference(desk):
    source = desk.put("job.pdl", program(FIRST, POSE, NEXT, POSE, NEXT))
    alone = simulate_file(source, desk.cell, SEED, path=True)
    itself = simulate_file(source, desk.cell, SEED, reference=source, path=True)
    assert alone.to_json() == itself.to_json() and len(alone.paths.visit) == 4


FLY = f"MOVEFLY {POSE.removeprefix('MOVE ')} ADVANCE"


@pytest.mark.parametrize(
    ("lines", "left"),
    [(["IF a THEN", FIRST, "ELSE", FLY, "ENDIF"], 1), ([FIRST, FLY], 0)],
)
def test_fly_points_that_the_run_does_not_go_on_from_are_told(desk, lines, left):
    source = desk.put("job.pdl", program(FIRST, *lines, NEXT))
    given = "simulate", source, "--cell", desk.cell, "--reference", source
    told = json.loads(cli(*given, "--report", "-").stdout)
    assert told.get("left_out", 0) == left and told["true_error"]["n"] == 4 - left
    said = "1 fly points without a score: no move continues from them"
    assert (said in cli(*given).output) == bool(left)


def test_another_program_cannot_be_the_wanted_one(desk):
    source, other = (desk.put(n, program(*lines)) for n, lines in (
        ("a.pdl", (FIRST, POSE)), ("b.pdl", (FIRST,))))  # fmt: skip
    found = cli("simulate", source, "--cell", desk.cell, "--reference", other)
    assert found.exit_code == 2 and "two versions of one program" in found.stderr


@pytest.mark.parametrize("effects", ["nonsense", "compliance@9"])
def test_unknown_effects_are_refused(desk, effects):
    source = desk.put("job.pdl", program(FIRST))
    found = cli(
        "simulate",
        source,
        "--cell",
        desk.cell,
        "--set",
        f"simulation.effects={effects}",
    )
    assert found.exit_code == 2 and found.stderr.startswith("postproc: ")


def test_no_known_target_is_told_and_is_valid_json(desk):
    source = desk.put("job.pdl", program("MOVE LINEAR TO p"))
    found = cli("simulate", source, "--cell", desk.cell, "--reference", source,
                "--report", "-")  # fmt: skip
    assert found.exit_code == 0
    assert json.loads(found.stdout)["true_error"]["mean_mm"] is None


def test_the_cell_gives_the_probe_points(desk):
    cell = load_cell(desk.cell)
    tools = setup_of(cell).tools
    np.testing.assert_allclose(tools[:, :3, 3], cell.probes)


def test_the_usual_virtual_arm_is_the_one_of_its_file():
    chain = chain_of(read_arm_file(arm_path("nj220-2.7")))
    for name, value in vars(NJ220).items():
        np.testing.assert_array_equal(getattr(chain, name), value)


@pytest.mark.parametrize("name", [a for a in list_shipped_arms() if "nj2" not in a])
def test_any_arm_file_has_its_virtual_arm(desk, name):
    """A survey of it is run, and its model finds the errors of its own chain."""
    nests = "[survey]\npoints_mm = [[100, 0, 100], [0, 100, 150], [-100, 0, 200]]\n"
    cell = load_cell(desk.put("own.toml", f'[robot]\narm = "{name}"\n{nests}'))
    source, rows = desk.folder / "survey", desk.folder / "m.csv"
    write_survey(cell, source, 60)
    source = source.rename(source.with_suffix(suffix_of(source.read_bytes())))
    simulate_file(source, cell).write(rows)
    found = fit(rows, cell=cell, program=source, effects=("geometry", "backlash"))
    assert found.report.before.mean_mm > 1.0
    assert found.report.after.mean_mm < 0.1


def suffix_of(text):
    return language_of_text(text).suffixes[0]
