"""Any small motion of a link by anything that drives it, planted by its text."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.exceptions import PostprocError
from postproc.simulation import Planted, parse_effects, virtual_arm
from postproc.simulation.part_motion import PlantedMotion
from postproc.simulation.reference import reference_arrivals
from postproc.simulation.state import VirtualArrivals

TEXT = "rotation:link3:x by temperature linear"


def moved(text: str, peak_mm: float = 0.1) -> tuple[np.ndarray, VirtualArrivals]:
    arm, perfect = virtual_arm(3, [Planted(text, 0, peak_mm)]), virtual_arm(3, ())
    arrivals = reference_arrivals(400)
    return arm.tcp(arrivals) - perfect.tcp(arrivals), arrivals


def test_a_cell_is_read_from_its_text_with_and_without_a_size() -> None:
    assert parse_effects(f"{TEXT} 0.02") == (Planted(TEXT, 0, 0.02),)
    assert parse_effects(f"lag, {TEXT}=1") == (Planted("lag"), Planted(TEXT, 0, 1.0))
    harmonic = "shift:tool:z by lambda 4 * joint 5 harmonic 2"
    assert parse_effects(f"{harmonic} 0.1")[0] == Planted(harmonic, 0, 0.1)
    assert parse_effects(harmonic)[0] == Planted(harmonic)
    assert str(PlantedMotion.parse(harmonic)) == harmonic


@pytest.mark.parametrize(
    "text",
    [
        "rotation:link7:x by temperature linear",
        "rotation:link3:x by heat linear",
        "rotation:link3:x by temperature cubic",
        "turn:link3:x by temperature linear 0.1",
    ],
)
def test_what_is_no_cell_is_refused_with_how_to_write_one(text: str) -> None:
    with pytest.raises(PostprocError, match="Write \\(rotation"):
        parse_effects(text)


def test_its_largest_displacement_is_the_size_asked_for() -> None:
    error, _ = moved(TEXT, 0.25)
    assert np.linalg.norm(error, axis=1).max() == pytest.approx(0.25e-3, rel=1e-3)


def test_a_shift_of_the_tool_keeps_its_direction_in_the_flange() -> None:
    error, arrivals = moved("shift:tool:z by payload linear")
    flange = virtual_arm(3, ()).nominal.flange(arrivals.q)[:, :3, :3]
    own = np.einsum("nij,ni->nj", flange, error)
    np.testing.assert_allclose(own[:, :2], 0.0, atol=1e-12)
    ratio = own[arrivals.payload > 0, 2] / arrivals.payload[arrivals.payload > 0]
    np.testing.assert_allclose(ratio, ratio[0])


def test_products_and_laws_follow_their_drivers() -> None:
    error, arrivals = moved("shift:base:x by lambda 4 * joint 5 step")
    size = error[:, 0] * np.sign(arrivals.side[:, 3])
    assert len(np.unique(np.round(size, 9))) == 2  # on, or off
    on = np.abs(size) > 1e-9
    assert arrivals.q[on, 4].min() > arrivals.q[~on, 4].max()


def test_a_driver_that_does_not_vary_is_refused() -> None:
    with pytest.raises(PostprocError, match="moment 2y does not vary"):
        virtual_arm(3, ["rotation:link3:x by moment 2y linear"])
