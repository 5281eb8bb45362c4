"""A check says beforehand what it finds, and what it cannot see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.calibration.check_design import design_check
from postproc.record.check_rows import place_check
from postproc.record.control import Watch
from postproc.record.foresight import foresee
from postproc.record.knowledge import Knowledge
from tests.calibration.simulator import NJ
from tests.record.conftest import Drawn
from tests.record.drawn_robots import measure


def test_what_is_foreseen_is_what_the_check_finds(drawn: Drawn) -> None:
    design = design_check(NJ, drawn.cell.probes, 10, None, 3, drawn.model)
    foreseen = foresee(drawn.cell, drawn.model, design)
    q, side = design.q, design.side.astype(float)
    rows = measure(drawn.robot, q, side, np.random.default_rng(21), 1)
    verdict, _ = Watch(Knowledge.of(drawn.model, NJ)).judge(
        place_check(rows, NJ, drawn.model, "tracker")
    )
    for name in ("zero of joint 2", "zero of joint 3", "zero of joint 5"):
        # other nests are read here and there: the same within a half
        assert 0.5 < foreseen.found[name] / verdict.power.found[name] < 2.0


def test_a_check_without_fixed_points_says_what_it_cannot_see(drawn: Drawn) -> None:
    design = design_check(NJ, drawn.cell.probes, 10, None, 3, drawn.model)
    seen = foresee(drawn.cell, drawn.model, design)
    blind = foresee(drawn.cell, replace(drawn.model, monuments=()), design)
    assert "base" not in seen.blind
    assert {"base", "zero of joint 1"} <= set(blind.blind)
    assert all(np.isfinite(seen.found[f"zero of joint {j}"]) for j in (2, 3))
