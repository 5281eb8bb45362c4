from __future__ import annotations

import numpy as np

from postproc.model.validity import Ranges
from postproc.robot.state import make_states
from tests.calibration.simulator import PLATE, TOOL, covariates, random_states

NOTHING: frozenset[str] = frozenset()


def survey(tools: np.ndarray = TOOL[None]):  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(0)
    return covariates(random_states(100, rng, tools), rng)


def test_the_survey_itself_lies_inside() -> None:
    for tools in (TOOL[None], PLATE):
        states = survey(tools)
        assert Ranges.of(states).outside(states, NOTHING) == {}


def test_an_axis_surveyed_all_around_has_no_outside() -> None:
    states = survey()
    q = np.array(states.q)
    q[:, 5] = np.linspace(-3.1, 3.1, 100)
    ranges = Ranges.of(states.with_(q=q))
    far = make_states(q[:3] + 20 * np.pi * np.eye(6)[5] + 3.0 * np.eye(6)[5], tool=TOOL)
    assert ranges.outside(far, NOTHING) == {}


def test_whole_turns_do_not_matter_but_angles_do() -> None:
    ranges = Ranges.of(survey())
    q = survey().q[:2] + np.array([[0, 0, 0, 2 * np.pi, 0, 0], [0, 2.0, 0, 0, 0, 0]])
    found = ranges.outside(make_states(q, tool=TOOL), NOTHING)
    assert len(found) == 1
    (text, rows), = found.items()  # fmt: skip
    assert text.startswith("axis 2") and rows.tolist() == [False, True]


def test_loads_and_heat_are_compared_where_they_were_recorded() -> None:
    states = survey()
    ranges = Ranges.of(states)
    hot = states.with_(temperature=np.full(100, 45.0))
    (text,) = ranges.outside(hot, NOTHING)
    assert text.startswith("temperature is outside the surveyed 20 to 30 deg C: ")
    tenths = states.with_(temperature=np.full(100, 30.9))
    assert ranges.outside(tenths, NOTHING) == {}
    warm = states.with_(temperature=np.full(100, 31.1))
    assert len(ranges.outside(warm, NOTHING)) == 1
    unknown = states.with_(payload=np.full(100, np.nan))
    assert ranges.outside(unknown, NOTHING) == {}
    assert list(ranges.outside(unknown, frozenset({"payload"}))) == [
        "payload is not known, and the model needs it"
    ]
    bare = Ranges.of(random_states(50, np.random.default_rng(1)))
    assert bare.payload is None and "payload" not in str(bare.outside(hot, NOTHING))


def test_collinear_points_do_not_show_all_rotations() -> None:
    line = TOOL + np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    assert not Ranges.of(survey(line)).see_all_rotations
    assert Ranges.of(survey(PLATE)).see_all_rotations
    assert not Ranges.of(survey()).see_all_rotations


def of(low: float, high: float, tool: tuple[float, ...] = (0.1, 0.0, 0.2)) -> Ranges:
    """Make ranges that are the same for all joints."""
    return Ranges(6 * (low,), 6 * (high,), (tool,), (low, high), None, None)


def test_a_revised_model_covers_what_it_knew_and_the_fresh_rows() -> None:
    both = of(-1.0, 1.0).join(of(0.5, 1.5, (0.3, 0.0, 0.1)))
    assert (both.lower, both.upper) == (6 * (-1.0,), 6 * (1.5,))
    assert both.payload == (-1.0, 1.5) and both.temperature is None
    assert both.tools == ((0.1, 0.0, 0.2), (0.3, 0.0, 0.1))


def test_of_ranges_that_lie_apart_or_have_changed_the_fresh_ones_count() -> None:
    apart = of(-1.0, 1.0).join(of(1.2, 1.5))
    assert (apart.lower, apart.upper) == (6 * (1.2,), 6 * (1.5,))
    some = of(-1.0, 1.0).join(of(0.0, 1.5, (0.3, 0.0, 0.1)), {"5", "payload", "tool"})
    assert some.lower == (*(4 * (-1.0,)), 0.0, -1.0)
    assert some.payload == (0.0, 1.5) and some.tools == ((0.3, 0.0, 0.1),)


def test_a_bent_law_of_temperature_ends_where_the_survey_ends() -> None:
    states = survey()
    ranges, bent = Ranges.of(states), frozenset({"temperature"})
    warm = states.with_(temperature=np.full(100, 30.9))
    (text,) = ranges.outside(warm, NOTHING, bent)
    assert text.startswith("temperature is outside the surveyed 20 to 30 deg C: ")
    tenths = states.with_(temperature=np.full(100, 30.4))
    assert ranges.outside(tenths, NOTHING, bent) == {}
