"""What a plain fit leaves of causes that must be found before they can be fitted.

PYTHONPATH=. python docs/studies/sought.py [--seeds 1 12]

Each virtual arm is surveyed at 300 poses with one cause that nobody declared: a step of
a joint's zero, a base that tilts under the weight, a wave of a motor whose gear ratio
is known, a warm-up of which only the order of the rows tells. `fit` is asked for
nothing. Mean true error at other poses: of geometry and backlash alone, of the fit, and
of one that is told the cause; medians over the arms.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.calibration.effect_selection import attribute_drift, fit_best
from postproc.model.effects import BASE_EFFECTS
from tests.calibration.planted import TRACKER, Campaign, campaign
from tests.undeclared_trial import true_errors

KINDS = ("joint_step", "base_tilt", "motor_wave", "warmup")
SIZES = (0.5, 1.0, 2.0)  # of the cause, over the noise
ROWS = 300


def untold(c: Campaign) -> Campaign:
    """Forget when the rows were measured, and how warm it was."""
    nothing = np.full(len(c.states), np.nan)
    states = c.states.with_(time=nothing, temperature=nothing)
    return replace(c, states=states)


def trial(kind: str, size: float, seed: int) -> tuple[list[float], tuple[str, ...]]:
    """Return true errors [mm], and what the fit named."""
    c = campaign(seed, (kind,), size, ROWS)
    c = untold(c) if kind == "warmup" else c
    fit = attribute_drift(
        fit_best(c.declared, c.states, c.position, tuple(TRACKER)), None
    )
    plain, _ = true_errors(c, seed, c.base_fit(), fit)
    named = [e.name for e in fit.combination.effects if e.name not in BASE_EFFECTS]
    return list(plain), tuple(dict.fromkeys(named)) or ("nothing",)


def table(first: int, last: int) -> Iterator[str]:
    """Write the rows of the table."""
    yield "| cause | size | without it | fit | told | named |"
    yield "|---|---|---|---|---|---|"
    for kind in KINDS:
        for size in SIZES:
            found = [trial(kind, size, seed) for seed in range(first, last + 1)]
            before, fitted, told = np.median([errors for errors, _ in found], axis=0)
            named = Counter(name for _, names in found for name in names)
            words = ", ".join(f"{name} {k}" for name, k in named.most_common())
            yield (
                f"| {kind} | {size:g} | {before:.4f} | {fitted:.4f} | {told:.4f} "
                f"| {words} |"
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(1, 12))
    for line in table(*parser.parse_args().seeds):
        print(line, flush=True)


if __name__ == "__main__":
    main()
