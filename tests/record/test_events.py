"""Every effect says which events renew it."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.model.effects import EFFECTS, kind_of
from postproc.model.effects.effect import EVENTS
from postproc.record.events import Event, open_base, sizes_of
from tests.record.conftest import Drawn


@pytest.mark.parametrize("kind", EFFECTS, ids=lambda kind: kind.name)
def test_renewals_are_events(kind: type) -> None:
    assert set(kind.renewed_by) <= set(EVENTS)


def test_what_belongs_to_a_survey_is_renewed_by_nothing() -> None:
    placed = kind_of("registration")()
    assert set(placed.list_renewals()) == {frozenset()}


def test_waves_of_the_output_side_outlive_a_motor() -> None:
    waves = kind_of("transmission")(waves=((4, 2.0), (4, 8.0)))
    slow, _, fast, _ = waves.list_renewals()
    assert "motor" not in slow and "gear" in slow
    assert "motor" in fast and "gear" in fast


def freed(drawn: Drawn, event: Event) -> set[str]:
    model = open_base(drawn.model)
    return {
        name
        for name, is_free in zip(
            model.effects.names, event.frees(model.effects), strict=True
        )
        if is_free
    }


def test_an_event_frees_what_its_definition_says(drawn: Drawn) -> None:
    assert freed(drawn, Event("remastered", (2, 3))) == {
        "geometry.theta2", "geometry.theta3",
    }  # fmt: skip
    assert freed(drawn, Event("tool")) == {f"geometry.tool_{a}" for a in "xyz"}
    gear = freed(drawn, Event("gear", (2,)))
    assert {"geometry.theta2", "backlash.b2"} < gear
    assert not any(
        name.startswith("geometry.base") for name in freed(drawn, Event("arm"))
    )
    crash = freed(drawn, Event("crash"))
    assert {"geometry.base_x", "geometry.a3", "backlash.b1"} < crash


def test_an_opened_base_is_known_to_be_where_the_survey_had_it(drawn: Drawn) -> None:
    model = open_base(drawn.model)
    assert open_base(model) is model
    names = model.effects.names
    base = [k for k, name in enumerate(names) if name.startswith("geometry.base")]
    assert len(base) == 6
    assert not model.values[base].any()
    assert not model.covariance[base].any()
    old = [names.index(name) for name in drawn.model.effects.names]
    assert np.array_equal(model.values[old], drawn.model.values)
    assert np.array_equal(model.covariance[np.ix_(old, old)], drawn.model.covariance)
    assert (sizes_of(model) > 0).all()
