"""Sensors, conveyors, calibration and payload: what targets mean under them."""

from __future__ import annotations

import math

import pytest

from postproc.language.pdl2.conditions import disturbance
from postproc.language.pdl2.values import Nothing
from tests.language.pdl2.test_external_routines import (
    FIRST,
    followed,
    handler,
    reasons,
    routine,
)


def test_a_stated_payload_is_used() -> None:
    visits = followed("$TOOL_MASS := 41", FIRST).visits
    assert (
        visits.motion.loads[visits.motion.load[0]][0] == 41.0 and not visits.reason[0]
    )
    none = followed(FIRST).visits
    assert math.isnan(none.motion.loads[none.motion.load[0]][0])


def test_a_payload_that_is_not_known_is_left() -> None:
    found = disturbance({"tool_mass": Nothing("it is read")})
    assert found and "not known here: it is read" in found.text
    assert not disturbance({"tool_mass": 4.0})


def test_what_a_way_around_may_leave_on_counts() -> None:
    body = ["IF $DIN[1] THEN", "$SENSOR_ENBL := TRUE", "ENDIF", FIRST]
    assert "$SENSOR_ENBL" in reasons(followed(*body))[0]


def test_what_a_handler_may_switch_on_counts() -> None:
    assert "$CONV_ENBL" in reasons(followed(*handler("$CONV_ENBL := ON"), FIRST))[0]


@pytest.mark.parametrize("inner", ["SENSOR_TRK(TRUE)", "$CAL_SYS[1] := 3"])
def test_what_a_function_switches_on_counts(inner: str) -> None:
    head = ["VAR n : INTEGER", *routine("f", inner, "RETURN(1)", takes=": INTEGER")]
    assert reasons(followed(FIRST, "n := f", FIRST, head=head))[1]
    assert reasons(followed(*handler(inner), FIRST))[0]


def test_what_is_set_for_one_move_counts_for_it() -> None:
    visits = followed(f"{FIRST} WITH $TOOL_MASS = 9", FIRST).visits
    masses = visits.motion.loads[visits.motion.load, 0].tolist()
    assert masses[0] == 9.0 and math.isnan(masses[1])
