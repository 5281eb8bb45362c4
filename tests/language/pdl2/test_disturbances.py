"""Sensors, conveyors, calibration and payload: what targets mean under them."""

from __future__ import annotations

import math

import pytest

from postproc.language.pdl2.disturbances import disturbance
from postproc.language.pdl2.values import Nothing
from tests.language.pdl2.test_routines import FIRST, followed, handler, reasons, routine


@pytest.mark.parametrize(
    ("mass", "payload", "said"),
    [
        (40.0, 40.0, ""),
        (40.04, 40.0, ""),
        (41.0, 40.0, "is 41 kg and the cell file gives 40 kg"),
        (40.0, math.nan, "the cell file gives none"),
        (Nothing("it is read"), 40.0, "not known here: it is read"),
    ],
)
def test_the_payload_must_be_that_of_the_cell(mass, payload, said) -> None:
    found = disturbance({"tool_mass": mass}, payload)
    assert said in found and bool(found) is bool(said)


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
    found = reasons(followed(f"{FIRST} WITH $TOOL_MASS = 9", FIRST, payload_kg=8.0))
    assert "is 9 kg" in found[0] and found[1] == ""
