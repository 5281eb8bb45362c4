"""Intervals of a reading hold what they say, in both frames."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.calibration.effect_selection import fit_survey
from postproc.calibration.fit import fit_measurements
from postproc.calibration.measurements import Measurements
from postproc.calibration.readings import Readings
from postproc.calibration.registration import predict_registered
from postproc.calibration.stops import pool_readings
from postproc.exceptions import PostprocError
from postproc.model.effects import BASE_EFFECTS
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model, load_model
from postproc.robot.cell import Cell, load_cell
from tests.calibration.simulator import NJ, random_arm, random_states, survey_of
from tests.campaign_rows import Habit, measure
from tests.written import cli

ROWS = 600
TURN, PLACE = Rotation.from_rotvec([0.1, -0.2, 2.0]).as_matrix(), [3.0, -2.0, 1.0]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text('[robot]\narm = "nj220-2.7"\n[tool]\nxyz_mm = [80, -40, 150]\n')
    return load_cell(path)


def readings(frame: str, drift: float = 0.0, seed: int = 2) -> Measurements:
    """Measure poses of one arm; the tracker drifts by so much [m] along x.

    Along z it would look like a first link that grows.
    """
    rng = np.random.default_rng(seed)
    states = random_states(ROWS, rng)
    position = random_arm(np.random.default_rng(0)).measure(states, rng)[0]
    position[:, 0] += np.linspace(0.0, drift, ROWS)
    if frame == "tracker":
        position = (position - PLACE) @ TURN
        states = states.with_(tool=np.zeros((ROWS, 3)))
    return survey_of(states, position)


def held(model: Model, rows: Measurements) -> float:
    """Share of coordinates inside the 95 % intervals."""
    states, position = rows.states, rows.position
    if model.registration is not None:
        states = model.registration.on_probes(states)
        position = model.registration.to_base(position)
    told = model.reading(NJ, states)
    off = position - ArmStates(NJ, states).walk.tcp - told.error
    return float((np.abs(off) < 1.96 * told.std).mean())


@pytest.mark.parametrize("frame", ["base", "tracker"])
def test_intervals_hold_rows_that_no_fit_has_seen(cell: Cell, frame: str) -> None:
    rows = readings(frame)
    every = np.arange(ROWS) % 3 > 0
    model = fit_measurements(rows[every], cell, effects=BASE_EFFECTS, frame=frame).model  # type: ignore[arg-type]
    # 600 coordinates: 0.95 +- 3 binomial standard deviations
    assert 0.923 < held(model, rows[~every]) < 0.977


def test_means_of_several_readings_scatter_less(cell: Cell) -> None:
    rng = np.random.default_rng(6)
    arm = random_arm(rng)
    habit = Habit(300, 5, 1, 1, 1, 5, 0.0, 0.0, 4e-5, clock=False)
    rows = pool_readings(measure(arm, habit, rng))
    every = np.arange(300) % 3 > 0
    model = fit_measurements(rows[every], cell, effects=BASE_EFFECTS).model
    assert 0.92 < held(model, rows[~every]) < 0.98


def test_a_drift_of_the_tracker_is_part_of_a_reading(cell: Cell) -> None:
    rows = readings("base", drift=4e-4)
    every = np.arange(ROWS) % 3 > 0
    found = fit_measurements(rows[every], cell)
    assert "tracker_drift" in {e.name for e in found.model.effects.effects}
    assert 0.92 < held(found.model, rows[~every]) < 0.98
    alone = found.model.error(NJ, rows[~every].states)
    off = rows[~every].position - ArmStates(NJ, rows[~every].states).walk.tcp - alone
    std = found.model.reading(NJ, rows[~every].states).std
    assert (np.abs(off) < 1.96 * std).mean() < 0.9


def test_another_registration_takes_nothing_but_itself(cell: Cell) -> None:
    rows, later = readings("tracker"), readings("base", seed=5)
    model = fit_measurements(rows, cell, effects=BASE_EFFECTS, frame="tracker").model
    moved = (later.position - [1.0, 4.0, 0.0]) @ TURN.T
    placed, told = predict_registered(model, NJ, later.states, moved)
    states = placed.on_probes(later.states)
    off = placed.to_base(moved) - ArmStates(NJ, states).walk.tcp - told.error
    share = float((np.abs(off) < 1.96 * told.std).mean())
    assert 0.935 < share < 0.965
    assert told.std.mean() < 6e-5  # of a reading, not of where nobody can know


def test_tails_widen_the_intervals() -> None:
    rows = readings("base")
    rng = np.random.default_rng(3)
    heavy = rows.position + 4e-5 * rng.standard_t(2.5, (ROWS, 3))
    even = fit_survey(rows, NJ, BASE_EFFECTS, None).reading_spread
    wide = fit_survey(survey_of(rows.states, heavy), NJ, BASE_EFFECTS, None)
    assert 1.0 <= even < 1.06 < wide.reading_spread < 2.0


def test_a_registration_is_kept_in_the_model(cell: Cell, tmp_path) -> None:
    rows = readings("tracker")
    model = fit_measurements(rows, cell, effects=BASE_EFFECTS, frame="tracker").model
    model.save(tmp_path / "m.json")
    again = load_model(tmp_path / "m.json")
    assert again.id == model.id and again.registration is not None
    T = model.registration.transforms[0]  # type: ignore[union-attr]
    np.testing.assert_array_equal(again.registration.transforms[0], T)
    place = again.registration.to_base(rows.position)
    back = (place - T[:3, 3]) @ T[:3, :3]
    np.testing.assert_allclose(back, rows.position, atol=1e-12)


def written(rows: Measurements, path) -> None:
    names = [f"q{j}_deg" for j in range(1, 7)] + [f"lambda{j}" for j in range(1, 7)]
    lines = [",".join(["id", *names, "x_mm,y_mm,z_mm"])]
    for k in range(len(rows)):
        numbers = [*np.rad2deg(rows.states.q[k]), *rows.states.direction[k]]
        numbers += [*(rows.position[k] * 1e3)]
        lines.append(",".join([str(k), *(f"{v:.6f}" for v in numbers)]))
    path.write_text("\n".join(lines) + "\n")


def test_predict_reads_in_the_tracker_s_frame(tmp_path) -> None:
    every = np.arange(ROWS) % 3 > 0
    rows = readings("tracker")
    written(rows[every], tmp_path / "fit.csv")
    written(rows[~every], tmp_path / "test.csv")
    setup = tmp_path / "cell.toml"
    setup.write_text('[robot]\narm = "nj220-2.7"\n')
    model = tmp_path / "m.json"
    effects = ("--effects", "geometry,backlash_profile,backlash")
    fitted = cli("fit", tmp_path / "fit.csv", "--cell", setup, "-o", model,
                 "--set", "measurements.frame=tracker", *effects)  # fmt: skip
    assert fitted.exit_code == 0, fitted.stderr
    ask = ("predict", tmp_path / "test.csv", "--cell", setup, "--model", model)
    for how in ("frame=tracker", "refit_registration=true"):
        told = cli(*ask, "--set", f"measurements.{how}")
        assert told.exit_code == 0, told.stderr
        header = told.stdout.splitlines()[0].split(",")
        assert {"reading_dx_mm", "reading_sz_mm", "rx_mm"} <= set(header)
        share = float(told.stderr.split("reading hold ")[1].split("%")[0])
        assert 92.3 < share < 97.7, told.stderr


def test_a_model_without_registration_finds_it_or_says_so(tmp_path) -> None:
    rows = readings("base")
    written(rows, tmp_path / "rows.csv")
    setup = tmp_path / "cell.toml"
    setup.write_text('[robot]\narm = "nj220-2.7"\n[tool]\nxyz_mm = [80, -40, 150]\n')
    model = tmp_path / "m.json"
    both = ("--cell", setup)
    cli("fit", tmp_path / "rows.csv", *both, "-o", model, "--effects", "geometry")
    ask = ("predict", tmp_path / "rows.csv", *both, "--model", model)
    told = cli(*ask, "--set", "measurements.frame=tracker")
    assert told.exit_code == 0 and "registration refitted" in told.stderr
    lines = (tmp_path / "rows.csv").read_text().splitlines()
    bare = [",".join(line.split(",")[:-3]) for line in lines]
    (tmp_path / "bare.csv").write_text("\n".join(bare) + "\n")
    told = cli(
        "predict",
        tmp_path / "bare.csv",
        *ask[2:],
        "--set",
        "measurements.frame=tracker",
    )
    assert told.exit_code == 0  # without positions there are no readings to predict
    assert "reading_" not in told.stdout.splitlines()[0]
    (tmp_path / "few.csv").write_text("\n".join(lines[:5]) + "\n")
    told = cli(
        "predict", tmp_path / "few.csv", *ask[2:], "--set", "measurements.frame=tracker"
    )
    assert told.exit_code == 2 and "Measure 6 poses or more" in told.stderr
    with pytest.raises(PostprocError, match="write registration"):
        Readings(refit="everything")
