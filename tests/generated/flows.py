"""The analysis of a generated job against its execution."""

from __future__ import annotations

import numpy as np

from tests.language.pdl2.interpreter import Interpreter
from tests.language.pdl2.test_flow_random import follow, generate

RUNS = 3  # executions of each program whose inputs are random


def flows(seed: int) -> None:
    """Check that the analysis contains what runs, and is exact where all is constant.

    Raises:
        AssertionError: It is not so.
    """
    made, visits = generate(seed, exact=False)
    for run in range(RUNS):
        follow(visits, Interpreter(made, run).run(), made)
    made, visits = generate(seed, exact=True)
    trace = Interpreter(made, 0, most=100_000).run()
    assert all(len(now) == 1 for now in follow(visits, trace, made))
    if made.whole.count("IF n") == 0 and "SELECT" not in made.whole:
        assert len(visits) == len(trace)
        assert (np.diff(visits.graph.pred_start) == 1).all()
