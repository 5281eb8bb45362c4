"""A program run in time, and how it keeps to its paths, in the keys of the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.compensation.findings.timing_comparison import InTime
from postproc.compensation.paths.corner_error import RoundOff
from postproc.compensation.paths.insertion_report import Insertions
from postproc.compensation.paths.path_error import Deviations, PathAccuracy
from postproc.language.visits import Visits
from postproc.model.statistics import ErrorStatistics
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

CURVES = 200  # moves whose curve is told: those that leave their path the most
POINTS = 40  # of a curve


def describe_timing(told: InTime, visits: Visits) -> dict[str, object]:
    """Describe how a program runs, and how it keeps to its paths."""
    paths, corners = told.paths, told.corners(visits)
    worst = set(np.argsort(-paths.after.sizes, kind="stable")[:CURVES].tolist())
    return {
        "timing": _timing(told, visits),
        "path_accuracy": {
            "before": asdict(ErrorStatistics.of_sizes(told.paths.before.sizes)),
            "after": asdict(ErrorStatistics.of_sizes(told.paths.after.sizes)),
            "unknown": paths.unknown,
            **_round_off(corners),
            **_fast_stops(told.inserted, visits),
        },
        "path": [
            _path(paths, k, visits)
            | _points(paths, k, told.inserted)
            | _corner(k, corners)
            | ({"curve": _curve(paths, k)} if k in worst else {})
            for k in range(len(paths))
        ],
    }


def _timing(told: InTime, visits: Visits) -> dict[str, object]:
    """Describe the cycle, what it uses of the joints, and where it is slowed down."""
    pair = {"before": told.before, "after": told.after}
    slowed = told.after.slow_moves
    share = told.after.clock.allowed[slowed].tolist()
    lines = visits.place.line[told.source(slowed)]

    def of(use: Callable[[ProgramCycle], tuple[Floats, Ints]]) -> dict[str, object]:
        before, (shares, rows) = use(told.before), use(told.after)
        after = shares, told.source(rows)
        pairs = zip(pair, (before, after), strict=True)
        return {key: _uses(*used, visits) for key, used in pairs}

    return {
        "cycle_s": {key: round(cycle.seconds, 3) for key, cycle in pair.items()},
        "guessed": list(told.guessed),
        "velocity_use": of(lambda cycle: cycle.velocity_use),
        "acceleration_use": of(lambda cycle: cycle.acceleration_use),
        "slowed": [
            {"line": line, "share": round(least, 4)}
            for line, least in zip(lines.tolist(), share, strict=True)
        ],
        "untimed": int(told.after.clock.untimed.sum()),
    }


def _uses(shares: Floats, rows: Ints, visits: Visits) -> list[dict[str, object]]:
    """Say how much of a limit every joint uses, and on the way to which line."""
    return [
        {
            "share": round(share, 4),
            "line": int(visits.place.line[row]) if row >= 0 else None,
        }
        for share, row in zip(shares.tolist(), rows.tolist(), strict=True)
    ]


def _path(paths: PathAccuracy, k: int, visits: Visits) -> dict[str, object]:
    """Describe how a move keeps to its path."""
    visit, samples = int(paths.visit[k]), paths.samples(k)
    pair = {"before": paths.before, "after": paths.after}

    def of(value: Callable[[Deviations], float]) -> dict[str, float]:
        return {key: round(value(told) / MM, 5) for key, told in pair.items()}

    return {
        "line": int(visits.place.line[visit]),
        "visit": visit,
        "move": Motion(visits.motion.kind[visit]).name,
        "length_mm": round(float(paths.way[samples.stop - 1]) / MM, 3),
        "max_mm": of(lambda told: float(told.across[told.largest[k]])),
        "at_mm": of(lambda told: float(paths.way[told.largest[k]])),
        "along_mm": of(lambda told: float(np.abs(told.along[samples]).max())),
        "uncertainty_mm": of(lambda told: float(told.unsure[samples].max())),
        "joint": {key: int(told.joint[k]) for key, told in pair.items()},
        "joints_mm": (paths.after.shares[k] / MM).round(5).tolist(),
    }


def _round_off(corners: RoundOff) -> dict[str, object]:
    """Describe how far rounded corners are passed, where there are any."""
    if not len(corners):
        return {}
    pair = {"before": corners.before, "after": corners.after}
    sizes = {key: asdict(ErrorStatistics.of_sizes(x)) for key, x in pair.items()}
    return {"cornering_round_off": sizes}


def _fast_stops(inserted: Insertions | None, visits: Visits) -> dict[str, object]:
    """Describe the targets that fast JOINT moves may miss, where there are any."""
    if inserted is None or not inserted.fast_stops:
        return {}
    stops = [
        {"line": int(visits.place.line[v]), "visit": v, "off_mm": round(off / MM, 5)}
        for v, off in inserted.fast_stops.items()
    ]
    return {"fast_stops": stops}


def _corner(k: int, corners: RoundOff | None) -> dict[str, object]:
    """Describe how far the corner at the end of a path is passed."""
    pair = None if corners is None else corners.of(k)
    if pair is None:
        return {}
    sizes = (round(size / MM, 5) for size in pair)
    return {"corner_mm": dict(zip(("before", "after"), sizes, strict=True))}


def _points(
    paths: PathAccuracy, k: int, inserted: Insertions | None
) -> dict[str, object]:
    """Describe the points that were put on a way, or why there are none."""
    visit, length = int(paths.visit[k]), float(paths.way[paths.samples(k).stop - 1])
    if inserted is None:
        return {"inserted": 0, "points": []}
    shares: list[tuple[float, dict[str, bool]]] = [
        (share, {}) for share in inserted.points.get(visit, ())
    ]
    if visit in inserted.approaches:
        shares = [(inserted.approaches[visit], {"approach": True})]
    told: dict[str, object] = {
        "inserted": len(shares),
        "points": [
            {"at_mm": round(share * length / MM, 3)} | more for share, more in shares
        ],
        "insertion_skipped": inserted.left.get(visit),
    }
    for key, far in (
        ("without_mm", inserted.without),
        ("promise_mm", inserted.promises),
        ("worst_mm", inserted.worst),
    ):
        told[key] = round(far[visit] / MM, 5) if visit in far else None
    return told


def _curve(paths: PathAccuracy, k: int) -> dict[str, list[float]]:
    """Tell the distance from the path along it, its largest values among them."""
    samples = paths.samples(k)
    n = samples.stop - samples.start
    at = np.unique(np.linspace(0, n - 1, min(n, POINTS)).astype(int))
    pair = {"before": paths.before, "after": paths.after}
    peaks = [int(told.largest[k]) - samples.start for told in pair.values()]
    rows = samples.start + np.union1d(at, peaks)
    across = {key: told.across for key, told in pair.items()}
    columns = {"way": paths.way, **across}
    return {
        f"{key}_mm": np.round(column[rows] / MM, 4).tolist()
        for key, column in columns.items()
    }
