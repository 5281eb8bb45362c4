"""Write docs/studies/undeclared.md and its plot from the scored trials."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import beta

from tests.calibration.planted import NAMED, NAMELESS, REVISED, SIZES, WAVES
from tests.undeclared_score import (
    WITHIN,
    close,
    close_as_it_stands,
    groups,
    laws,
    misnamed,
    ok,
)

if TYPE_CHECKING:
    from tests.undeclared_trial import Trial

PART_SIZES = (0.1, 0.25, 0.5, 1.0)  # between which joints of a law are counted

INTRODUCTION = """# Tracing effects that nobody declared

Written by `{command}`. Each trial draws a virtual arm with geometry, tool and
backlash errors and one undeclared effect (or two, or none) by seed, surveys it with 400
rows, fits geometry and backlash, and diagnoses the residuals. The virtual arm shares no
code with the model, and its link masses, load laws and shapes are not the model's
nominal ones. Size is the effect's rms after projection on the base model, over the
noise. An answer is right when it names the effect and its joint, alone or in the group
that it says it cannot tell apart; an effect without a name is answered rightly by a
`curve` on its joint or by the verdict `unexplained`. A name counts as given with
confidence if p < 0.001 and no curve is listed with it. The true error is that of the
arm at 200 fresh poses, without noise; the informed fit knows the shape of what was
planted and fits its size. Campaigns of `elastic_flank` go straight from row to row and
tell neither travels nor directions. Waves of motors and errors of coupled drives are
those of an arm whose file tells its gear ratios and the coupling of its wrist. Bounds
hold at 95 % (Clopper and Pearson).

"""
DRIFT = """`tracker_drift`, `azimuth` and `refraction` move nothing of the arm and are
never compensated. What an extended model misses there is mostly one rigid displacement:
the place of the base cannot be separated from the start of a drift of unknown shape,
nor from the direction of a circle. The informed fit knows shape and phase. Such a
displacement moves all targets of a cell together, as an error of its registration does,
and changes nothing between them. So in campaigns with one of these three the rigid
displacement that fits best is removed from the errors of both fits, here and in the
figure above; "as it stands" takes out nothing.
"""


def write_table(
    trials: Sequence[Trial], output: Path, wanted: int, command: str
) -> None:
    """Write the page, and the plot beside it, of so many of the trials wanted."""
    by_kind: dict[str, list[Trial]] = defaultdict(list)
    for t in trials:
        by_kind[t.kind].append(t)
    kinds = [k for k in (*NAMED, *REVISED, *WAVES, *NAMELESS, "two") if k in by_kind]
    planted = [t for t in trials if t.kind != "none"]
    lines = [
        *INTRODUCTION.format(command=command).splitlines(),
        *_summary(trials, wanted),
        "",
        *_by_size(planted),
        "",
        f"![rate against size]({plot(planted, output.with_suffix('.png')).name})",
        "",
        "## By kind",
        "",
        *_by_kind(kinds, by_kind),
        "",
        *DRIFT.splitlines(),
        "",
        "## Joints of a compliance of two",
        "",
        *_parts(by_kind.get("compliance", [])),
        "",
        "## First findings",
        "",
        *_confusion(kinds, by_kind),
        "",
        "## Every answer that was not right",
        "",
        *_wrong(trials),
    ]
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rate(hits: Sequence[bool]) -> str:
    return f"{sum(hits)} / {len(hits)}" if hits else "-"


def _bounded(hits: Sequence[bool]) -> str:
    """Write a rate with what it is at least, at 95 % (Clopper and Pearson, 1934)."""
    right, n = sum(hits), len(hits)
    least = beta.ppf(0.05, right, n - right + 1) if right else 0.0
    return f"{_rate(hits)} (at least {least:.1%})" if n else "-"


def _summary(trials: Sequence[Trial], wanted: int) -> list[str]:
    none = [t for t in trials if t.kind == "none"]
    named = [t for t in trials if t.kind in (*NAMED, *REVISED, *WAVES)]
    nameless = [t for t in trials if t.kind in NAMELESS]
    two = [t for t in trials if t.kind == "two"]
    planted = [*named, *nameless, *two]
    large = [t for t in named if t.size >= 1]
    small = [t for t in named if t.size < 1]
    sizes = groups(named) or [1]
    seeds = sorted({t.seed for t in trials})
    seconds = np.median([t.seconds for t in trials])
    return [
        f"- {len(trials)} of {wanted} trials, seeds {seeds[0]} to {seeds[-1]}",
        "- named effects at 1 to 2 times the noise: "
        + _bounded([ok(t) for t in large]),
        "- named effects at 0.3 and 0.5 of the noise: "
        + _bounded([ok(t) for t in small]),
        f"- two at once, both right: {_bounded([ok(t) for t in two])}",
        f"- without a name: {_bounded([ok(t) for t in nameless])}; given a name with "
        f"confidence: {_rate([misnamed(t) for t in nameless])}",
        f"- nothing planted, verdict `noise`: {_bounded([ok(t) for t in none])}; "
        f"effects added: {_rate([bool(t.found) for t in none])}",
        f"- groups: median {np.median(sizes):.0f}, largest {max(sizes)}",
        f"- true error at fresh poses within {WITHIN} times an informed fit's: "
        f"{_bounded([close(t) for t in planted])}; as it stands (see below): "
        f"{_rate([close_as_it_stands(t) for t in planted])}",
        f"- processor time of a search: median {seconds:.1f} s",
    ]


def _by_size(planted: Sequence[Trial]) -> list[str]:
    lines = [
        "| size | named, right | two, right | no name, right "
        "| true error before | after | informed |",
        "|---|---|---|---|---|---|---|",
    ]
    for size in SIZES:
        some = [t for t in planted if t.size == size]
        cells = [
            _rate([ok(t) for t in some if t.kind in (*NAMED, *REVISED, *WAVES)]),
            _rate([ok(t) for t in some if t.kind == "two"]),
            _rate([ok(t) for t in some if t.kind in NAMELESS]),
        ]
        errors = np.mean([t.true_mm for t in some], axis=0) if some else np.zeros(3)
        cells += [f"{e:.4f} mm" for e in errors]
        lines.append(f"| {size:g} | " + " | ".join(cells) + " |")
    return lines


def _by_kind(kinds: list[str], by_kind: dict[str, list[Trial]]) -> list[str]:
    sizes = " | ".join(f"size {s:g}" for s in SIZES)
    lines = [
        f"| planted | right | {sizes} | without its group | more than planted "
        f"| within {WITHIN} of informed | as it stands |",
        "|---" * (len(SIZES) + 6) + "|",
    ]
    for kind in kinds:
        some = by_kind[kind]
        cells = [_rate([ok(t) for t in some])]
        cells += [_rate([ok(t) for t in some if t.size == s]) for s in SIZES]
        cells.append(_rate([t.alone for t in some]))
        cells.append(_rate([len(t.found) > laws(t) for t in some]))
        cells.append(_rate([close(t) for t in some]))
        cells.append(_rate([close_as_it_stands(t) for t in some]))
        lines.append(f"| {kind} | " + " | ".join(cells) + " |")
    return lines


def _parts(trials: Sequence[Trial]) -> list[str]:
    """Count the joints of a law of two by the size of each one's own part."""
    lines = [
        "Size is that of one joint's part after projection on the base model and on "
        "the other joint's part.",
        "",
        "| own size | named |",
        "|---|---|",
    ]
    parts = [(size, named) for t in trials for _, size, named in t.parts]
    for low, high in pairwise((0.0, *PART_SIZES, np.inf)):
        hits = [named for size, named in parts if low <= size < high]
        lines.append(f"| {low:g} to {high:g} | {_rate(hits)} |")
    return lines


def _confusion(kinds: list[str], by_kind: dict[str, list[Trial]]) -> list[str]:
    singles = [k for k in (*kinds, "none") if k != "two" and k in by_kind]
    said = {k: Counter(_first(t) for t in by_kind[k]) for k in singles}
    names = sorted({name for counts in said.values() for name in counts})
    lines = [
        "| planted | " + " | ".join(names) + " |",
        "|---" * (len(names) + 1) + "|",
    ]
    for kind in singles:
        cells = [str(said[kind][name] or "") for name in names]
        lines.append(f"| {kind} | " + " | ".join(cells) + " |")
    return lines


def _first(t: Trial) -> str:
    """Name what was found first: effect, and whether the joint is right."""
    if not t.found:
        return t.verdict
    effect, joint = t.found[0]["effect"], t.found[0]["joint"]
    right = any(joint in joints or not joints for _, joints, _ in t.truth)
    return f"{effect}" if right else f"{effect}, wrong joint"


def _wrong(trials: Sequence[Trial]) -> list[str]:
    lines = []
    for t in trials:
        if ok(t):
            continue
        truth = ", ".join(f"{e or 'no name'} {j}" for e, j, _ in t.truth) or "nothing"
        found = ", ".join(
            f"{f['effect']} {f['joint']} (p = {float(str(f['p'])):.0e})"
            for f in t.found
        )
        lines.append(
            f"- {t.kind}, seed {t.seed}, size {t.size:g}: {truth}; found {t.verdict}, "
            f"{found or 'nothing'}"
        )
    return lines or ["none"]


def plot(planted: Sequence[Trial], path: Path) -> Path:
    """Draw the rate of right answers against size."""
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    for label, kinds, mark in (
        ("named", (*NAMED, *REVISED, *WAVES), "o-"),
        ("two at once", ("two",), "s--"),
        ("no name", NAMELESS, "^:"),
    ):
        rates = [
            [ok(t) for t in planted if t.kind in kinds and t.size == s] for s in SIZES
        ]
        axes.plot(
            SIZES, [np.mean(r) if r else np.nan for r in rates], mark, label=label
        )
    axes.set_xlabel("rms after projection on the base model, over the noise")
    axes.set_ylabel("right answers")
    axes.set_ylim(0, 1.02)
    axes.legend(loc="lower right")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    return path
