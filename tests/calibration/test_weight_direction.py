"""An arm that does not stand as its cell says is noticed by how its joints yield."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from postproc.calibration.effect_selection import fit_best
from postproc.calibration.fit import fit_measurements
from postproc.calibration.regression import NEARLY, fit_effects
from postproc.calibration.weight_direction import direction_warning, level_warning
from postproc.model.effects import BASE_EFFECTS, propose
from postproc.model.kinematics import ArmStates
from postproc.model.registration import Registration
from postproc.robot.cell import load_cell
from postproc.simulation import Planted, sample_survey, stream, virtual_arm
from tests.calibration.planted import ARM, BASE, TRACKER, states_of
from tests.calibration.simulator import TOOL, random_arm, random_states, survey_of

ROWS = 160


def survey(seed, pulls, *planted):
    """Measure an arm whose weight pulls in a direction, (3,)."""
    gravity = 9.80665 * np.array(pulls, dtype=float)
    every = (*map(Planted, BASE), *planted)
    arm = virtual_arm(seed, every, rows=ROWS, tracker=TRACKER, gravity=gravity)
    arrivals = sample_survey(arm, ROWS, seed=seed)
    position = arm.measure(arrivals, TRACKER, stream(seed, "tracker"))
    return states_of(arrivals), position


def base_fit(states, position, stated):
    """Fit geometry and backlash, weight pulling where the cell says."""
    arm = ARM.mount(np.array(stated, dtype=float))
    effects = propose(BASE_EFFECTS, arm, states)
    batch, place = ArmStates(arm, states), tuple(TRACKER)
    return fit_effects(batch, position, effects, place, until=NEARLY)


FLOOR, CEILING, WALL = (0, 0, -1), (0, 0, 1), (1, 0, 0)


@pytest.mark.parametrize(
    ("true", "stated", "named"),
    [
        (WALL, FLOOR, "[1, 0, 0]"), (FLOOR, WALL, "[0, 0, -1]"),
        (CEILING, FLOOR, "[0, 0, 1]"), (FLOOR, CEILING, "[0, 0, -1]"),
        (WALL, WALL, None), (FLOOR, FLOOR, None), (CEILING, CEILING, None),
    ],
)  # fmt: skip
def test_the_direction_that_the_rows_speak_for(true, stated, named):
    states, position = survey(11, true, Planted("compliance", 2, peak_mm=0.5))
    told = direction_warning(base_fit(states, position, stated))
    assert [f"along {named}" in line for line in told] == [True] * (named is not None)


@pytest.mark.parametrize("kind", ["transmission", "counterbalance", "base_tilt"])
def test_other_causes_are_no_other_direction(kind):
    states, position = survey(21, FLOOR, Planted(kind))
    fitted = fit_best(ARM, states, position, tuple(TRACKER))
    assert direction_warning(fitted) == ()


def test_few_rows_say_nothing():
    states, position = survey(11, WALL, Planted("compliance", 2, peak_mm=0.5))
    assert direction_warning(base_fit(states[:40], position[:40], FLOOR)) == ()


def leaning(*degrees):
    """Return a registration of trackers that lean in the base frame of the arm."""
    turns = Rotation.from_euler(
        "y", np.array(degrees)[:, None], degrees=True
    ).as_matrix()
    transforms = np.tile(np.eye(4), (len(degrees), 1, 1))
    transforms[:, :3, :3] = turns
    names = tuple(f"place {k}" for k in range(len(degrees)))
    return Registration(transforms, np.zeros((1, 3)), np.zeros(1, dtype=int), names)


@pytest.mark.parametrize(
    ("lean", "weight", "said"),
    [
        ((0.5,), FLOOR, None), ((90.0,), (-1, 0, 0), None), ((180.0,), CEILING, None),
        ((90.0,), FLOOR, "[-1, 0, 0]"), ((0.0,), CEILING, "[0, 0, -1]"),
        ((10.0,), FLOOR, "[-0.17, 0, -0.98]"), ((0.0, 30.0), FLOOR, "[-0.5, 0, -0.87]"),
    ],
)  # fmt: skip
def test_a_levelled_tracker_says_where_weight_pulls(lean, weight, said):
    found = level_warning(leaning(*lean), np.array(weight, dtype=float))
    assert [f"along {said}" in line for line in found] == [True] * (said is not None)
    assert all(("at place 1" in line) == (len(lean) > 1) for line in found)


@pytest.mark.parametrize("levelled", [True, False])
@pytest.mark.parametrize("mounting", ["floor", "wall"])
def test_a_cell_tells_that_the_tracker_is_levelled(tmp_path, levelled, mounting):
    rng = np.random.default_rng(1)
    states = random_states(60, rng)
    seen = random_arm(rng).measure(states, rng)[0] - [4.0, -3.0, 1.5]
    path = tmp_path / "cell.toml"
    path.write_text(
        f'[robot]\narm = "nj220-2.7"\nmounting = "{mounting}"\n[survey]\n'
        f"points_mm = [{(TOOL * 1e3).tolist()}]\nlevelled = {str(levelled).lower()}\n"
    )
    found = fit_measurements(
        survey_of(states, seen), load_cell(path), effects=("geometry", "backlash"),
        frame="tracker", validate=False,
    )  # fmt: skip
    asked = [w for w in found.report.warnings if "is levelled" in w]
    assert len(asked) == (levelled and mounting == "wall")


@pytest.mark.parametrize(
    ("mounting", "refused"), [("", True), ('mounting = "floor"', False),
                              ('mounting = "wall"', None)],
)  # fmt: skip
def test_no_model_is_written_where_only_the_user_knows(tmp_path, mounting, refused):
    states, position = survey(11, WALL, Planted("compliance", 2, peak_mm=0.5))
    path = tmp_path / "cell.toml"
    path.write_text(f'[robot]\narm = "{ARM.name}"\n{mounting}\n')
    found = fit_measurements(
        survey_of(states, position), load_cell(path), effects=("geometry", "backlash")
    )
    said = [w for w in found.report.warnings if "weight pulls along [1, 0, 0]" in w]
    assert len(said) == (refused is not None)
    assert ("weight pulls along [1, 0, 0]" in found.rejected) == (refused is True)
