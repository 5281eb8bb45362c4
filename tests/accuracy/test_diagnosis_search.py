"""Undeclared effects of virtual arms are found, and nothing is found where nothing is.

A small seeded selection of what `make undeclared` does at full size.
"""

from __future__ import annotations

import pytest

from tests.undeclared import run
from tests.undeclared_table import close, ok

PLANTED = [
    ("compliance", 300, 0.5),
    ("payload", 301, 0.5),
    ("transmission_free", 302, 0.5),
    ("coupling", 303, 1.0),
    ("load_backlash", 304, 1.0),
    ("warmup", 305, 1.0),
    ("windup", 306, 1.0),
    ("tool_shift", 307, 0.5),
    ("tracker_drift", 308, 1.0),
    ("worn_spot", 309, 1.0),
    ("joint_product", 310, 1.0),
    ("hysteresis", 311, 1.0),
    ("two", 312, 1.0),
]


@pytest.mark.parametrize(("kind", "seed", "size"), PLANTED)
def test_an_undeclared_effect_is_named(kind: str, seed: int, size: float) -> None:
    trial = run(kind, seed, size)
    assert ok(trial), trial
    assert all(len(f["group"]) <= 2 for f in trial.found)  # type: ignore[arg-type]
    assert trial.true_mm[1] < trial.true_mm[0]
    assert close(trial) or trial.true_mm[1] < 0.02, trial.true_mm


@pytest.mark.parametrize("seed", [320, 321, 322, 323, 324])
def test_nothing_is_found_where_nothing_is(seed: int) -> None:
    trial = run("none", seed, 0.0)
    assert trial.verdict == "noise", trial
    assert not trial.found
