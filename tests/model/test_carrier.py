"""Carriers move the tool as the virtual arm does, and every motion is there once."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.model.carrier import Carrier, carrier, every_carrier
from postproc.model.kinematics import ArmStates
from postproc.simulation import DEFAULT, Planted, virtual_arm
from tests.calibration.planted import ARM, states_of, survey

SIZE = 1e-3  # [mm] at the tool: small enough to be linear


def cell_of(moved: Carrier) -> str:
    """The cell of the virtual arm that a carrier is."""
    if moved.part == "joint":
        return f"rotation:link{moved.link}:z"
    how = "rotation" if moved.motion == "turn" else "shift"
    body = f"link{moved.link}" if moved.part == "link" else moved.part
    return f"{how}:{body}:{'xyz'[moved.axis]}"


@pytest.mark.parametrize("moved", every_carrier(), ids=str)
def test_a_carrier_moves_the_tool_as_the_virtual_arm_does(moved: Carrier) -> None:
    perfect = virtual_arm(1, ())
    arm = virtual_arm(1, [Planted(f"{cell_of(moved)} by speed constant", 0, SIZE)])
    arrivals = survey(perfect, 1, 12)
    true = arm.tcp(arrivals) - perfect.tcp(arrivals)
    column = moved.move(ArmStates(ARM, states_of(arrivals)))
    size = float((true * column).sum() / (column**2).sum())
    np.testing.assert_allclose(true, size * column, atol=2e-5 * np.abs(true).max())


def test_every_carrier_reads_back_from_its_text() -> None:
    every = every_carrier()
    assert [carrier(str(c)) for c in every] == list(every)
    assert len(set(every)) == len(every) == 42


@pytest.mark.parametrize("text", ["joint", "link 3 spin x", "base x", "tool turn w"])
def test_an_unknown_carrier_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"carrier|substring"):
        carrier(text)


def test_a_turn_turns_the_tool_and_a_shift_does_not() -> None:
    arrivals = survey(virtual_arm(1, DEFAULT), 1, 5)
    batch = ArmStates(ARM, states_of(arrivals))
    turned = carrier("link 4 turn y").turn(batch)
    assert turned is not None
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0)
    assert carrier("link 4 shift y").turn(batch) is None
