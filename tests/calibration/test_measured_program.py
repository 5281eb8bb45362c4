"""Points measured while a program ran, joined to its visits."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from postproc.calibration.measured_program import join_program
from postproc.calibration.tables import TableFormat
from postproc.compensation.program import plan_visits, read_program
from postproc.exceptions import MeasurementError
from tests.written import FIRST, NEXT, POSE, cli, program

ASSIGNED = "p := POS(120.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
MARKED = (
    *(FIRST, "-- MEASURE h1", POSE, NEXT, "-- MEASURE h2", POSE),
    *(ASSIGNED, "MOVE LINEAR TO p"),
)


@pytest.fixture
def join(desk, job_cell):
    source = desk.put("job.pdl", program(*MARKED))

    def joined(*ids, extra=""):
        rows = [f"{i},{k}.5,2,3{extra}" for k, i in enumerate(ids)]
        head = "id,x_mm,y_mm,z_mm" + (",temperature_c" if extra else "")
        data = desk.put("points.csv", "\n".join([head, *rows, ""]))
        return join_program(data, source, job_cell)

    return joined


def test_rows_take_the_states_of_their_visits_in_program_order(join, job_cell, desk):
    found = join("h2", "H1")
    assert found.ids == ("H1", "h2")
    np.testing.assert_allclose(found.position[:, 0], [1.5e-3, 0.5e-3])
    data = {"job.pdl": (desk.folder / "job.pdl").read_bytes()}
    visits = read_program(data, job_cell).visits
    plan = plan_visits(visits, job_cell).plan
    at = [visits.place.measure_id.index(name) for name in ("h1", "h2")]
    np.testing.assert_array_equal(found.states.q, plan.q[at])
    np.testing.assert_array_equal(found.states.direction, plan.side[at])


def test_a_variable_reached_once_is_an_id_too(join):
    assert join("P").ids == ("P",)


def test_recorded_columns_replace_the_cells(join):
    assert join("h1", extra=",31.5").states.temperature[0] == 31.5


def test_an_id_that_the_program_does_not_have(join):
    with pytest.raises(
        MeasurementError, match=r"points\.csv:3: id h9 has no visit.*MEA"
    ):
        join("h1", "h9")


def test_fit_from_ids_and_positions_equals_fit_from_full_rows(desk, tmp_path):
    survey, full, bare = (tmp_path / n for n in ("s.pdl", "full.csv", "bare.csv"))
    cell = ("--cell", desk.cell)
    cli("survey", *cell, "--poses", "40", "-o", survey)
    cli("simulate", survey, *cell, "-o", full)
    with full.open(newline="") as file:
        rows = list(csv.DictReader(file))
    with bare.open("w", newline="") as file:
        kept = csv.DictWriter(
            file, ["id", "x_mm", "y_mm", "z_mm"], extrasaction="ignore"
        )
        kept.writeheader()
        kept.writerows(rows)
    values = []
    for data, more in ((full, ()), (bare, ("--program", survey))):
        found = cli("fit", data, *cell, "-o", tmp_path / "m.json", "--effects",
                    "geometry,backlash", "--report", "-", *more)  # fmt: skip
        assert found.exit_code == 0, found.stderr
        rows = json.loads(found.stdout)["parameters"]
        values.append(next(r["value"] for r in rows if r["name"] == "geometry.a2"))
    assert values[0] == pytest.approx(values[1], abs=0.01)


def test_lists_of_points_of_other_tools_are_joined(desk, job_cell):
    source = desk.put("job.pdl", program(*MARKED))
    sa = desk.put("sa.txt", "// Group: A\nh2, 100.0, 200.0, 300.0\nh1, 4, 5, 600\n")
    leica = desk.put(
        "leica.txt", "Point Id;X [mm];Y [mm];Z [mm];Zeit\n'h1';1,5;2;3;'12:30'\n"
    )
    found = join_program(sa, source, job_cell)
    assert found.ids == ("h1", "h2")
    np.testing.assert_allclose(found.position[0], [4e-3, 5e-3, 0.6])
    found = join_program(leica, source, job_cell)
    np.testing.assert_allclose(found.position[0], [1.5e-3, 2e-3, 3e-3])
    metres = join_program(sa, source, job_cell, TableFormat(unit="m"))
    np.testing.assert_allclose(metres.position[0], [4.0, 5.0, 600.0])
