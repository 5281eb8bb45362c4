"""An arm that is as it was is in control; what moved is found and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from postproc.record.causes import causes_of, noncentrality
from postproc.record.check_rows import CheckRows, place_check
from postproc.record.control import CheckVerdict, Watch
from postproc.record.events import Event
from postproc.record.knowledge import Knowledge
from tests.calibration.simulator import NJ
from tests.record.conftest import Drawn
from tests.record.drawn_robots import Robot, measure

MONTHS = 10


def read(drawn: Drawn, robot: Robot, rng: np.random.Generator) -> CheckRows:
    rows = measure(robot, *drawn.poses, rng)
    return place_check(rows, NJ, drawn.model, "tracker")


@pytest.fixture(scope="module")
def months(drawn: Drawn) -> tuple[Watch, list[CheckVerdict]]:
    rng, watch, told = (
        np.random.default_rng(11),
        Watch(Knowledge.of(drawn.model, NJ)),
        [],
    )
    for _ in range(MONTHS):
        verdict, watch = watch.judge(read(drawn, drawn.robot, rng))
        told.append(verdict)
    return watch, told


def test_an_arm_that_is_as_it_was_is_in_control(
    months: tuple[Watch, list[CheckVerdict]],
) -> None:
    _, told = months
    # designed for 1 % alarms: more than one in ten has a chance of 0.4 %
    assert sum(not v.in_control for v in told) <= 1
    # T2 has its degrees of freedom on average, within four standard errors
    scaled = sum(v.statistic / v.free for v in told) / MONTHS
    assert abs(scaled - 1.0) < 4 * np.sqrt(2.0 / (told[0].free * MONTHS)) + 0.15


def test_what_a_survey_left_at_a_pose_is_no_alarm_month_after_month(
    drawn: Drawn, months: tuple[Watch, list[CheckVerdict]],
) -> None:  # fmt: skip
    watch, _ = months
    begun, known = Knowledge.of(drawn.model, NJ), watch.knowledge
    rows = read(drawn, drawn.robot, np.random.default_rng(12))
    before = begun.visiting(rows).expect(rows).precision
    after = known.expect(rows).precision
    assert np.trace(after) > np.trace(before)  # the arm is known better by now


CHANGED = {
    "zero of joint 2": ({"dh_theta": (1, 2e-4)}, Event("remastered", (2,))),
    "zero of joint 3": ({"dh_theta": (2, -2e-4)}, Event("remastered", (3,))),
    "zero of joint 5": ({"dh_theta": (4, 5e-4)}, Event("remastered", (5,))),
    "tool": ({"tool": (1, 3e-4)}, Event("tool")),
    "base": ({"base": (2, 8e-4)}, Event("base")),
}


def change(robot: Robot, changes: dict[str, tuple[int, float]]) -> Robot:
    moved = {}
    for name, (k, by) in changes.items():
        moved[name] = getattr(robot, name).copy()
        moved[name][k] += by
    return replace(robot, **moved)


@pytest.mark.parametrize("name", CHANGED)
def test_what_moved_is_found_and_named_at_the_next_check(
    name: str, drawn: Drawn, months: tuple[Watch, list[CheckVerdict]]
) -> None:
    watch, _ = months
    changes, _ = CHANGED[name]
    rows = read(drawn, change(drawn.robot, changes), np.random.default_rng(13))
    verdict, after = watch.judge(rows)
    assert not verdict.in_control
    named = [n for s in verdict.shown[:2] for n in (s.cause.name, *s.cause.also)]
    assert name in named
    assert after is watch  # it is not taken for what the arm is


def test_a_change_is_found_again_once_its_event_is_recorded(
    drawn: Drawn, months: tuple[Watch, list[CheckVerdict]]
) -> None:
    watch, _ = months
    changes, event = CHANGED["zero of joint 3"]
    robot, rng = change(drawn.robot, changes), np.random.default_rng(14)
    after = watch.after(event).take_in(read(drawn, robot, rng))
    theta = after.knowledge.model.effects.names.index("geometry.theta3")
    moved = after.knowledge.values[theta] - watch.knowledge.values[theta]
    std = np.sqrt(after.knowledge.covariance[theta, theta])
    assert abs(moved + 2e-4) < 4 * std + 2e-5
    verdict, _ = after.judge(read(drawn, robot, rng))
    assert verdict.in_control


def test_a_reading_that_went_wrong_is_named(
    drawn: Drawn, months: tuple[Watch, list[CheckVerdict]]
) -> None:
    watch, _ = months
    rows = read(drawn, drawn.robot, np.random.default_rng(15))
    position = rows.position.copy()
    position[7] += [4e-4, -3e-4, 2e-4]
    verdict, _ = watch.judge(replace(rows, position=position))
    assert not verdict.in_control
    assert verdict.shown[0].cause.name == "reading 8"
    assert "read it again" in verdict.shown[0].describe()


def test_without_fixed_points_the_base_is_not_seen(drawn: Drawn) -> None:
    rng = np.random.default_rng(16)
    blind = replace(drawn.model, monuments=())
    rows = measure(drawn.robot, *drawn.poses, rng)
    placed = place_check(rows, NJ, blind, "tracker")
    verdict, _ = Watch(Knowledge.of(blind, NJ)).judge(placed)
    assert {"base", "zero of joint 1"} <= set(verdict.power.blind)
    assert "zero of joint 2" not in verdict.power.blind


def test_causes_are_listed_once_with_all_their_names(drawn: Drawn) -> None:
    causes = causes_of(Knowledge.of(drawn.model, NJ).model)
    every = [tuple(c.own.tolist()) for c in causes]
    assert len(set(every)) == len(every)
    names = {n for c in causes for n in (c.name, *c.also)}
    assert {f"motor of joint {j}" for j in range(1, 7)} <= names


def test_the_power_of_a_check_is_that_of_noncentral_chi_square() -> None:
    limit, rng = float(chi2.isf(0.005, 30)), np.random.default_rng(17)
    away = np.zeros(30)
    away[0] = np.sqrt(noncentrality(limit, 30))
    drawn = ((rng.standard_normal((20_000, 30)) + away) ** 2).sum(axis=1)
    assert abs((drawn > limit).mean() - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 20_000)
