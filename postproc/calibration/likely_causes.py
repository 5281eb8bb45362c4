"""Which mistake in a measurement file explains its positions: found by trying them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Bools, Floats
from postproc.calibration.measurements import Measurements
from postproc.calibration.registration import register, robust_weights, typical_gap
from postproc.model.effect_sum import Combination
from postproc.model.effects.base_shift import rigid_motions
from postproc.model.effects.placement import Placement
from postproc.model.kinematics import ArmStates
from postproc.model.model import Model
from postproc.model.registration import Registration
from postproc.robot.arm import Arm
from postproc.robot.state import States

CLOSE = 0.01  # [m] a mended row agrees at least so well
BETTER = 5.0  # factor by which a cause of all rows lowers what is left
TRIED = 60  # rows that a guess of the frame is tried on
EXPLAINED = 0.9  # share of the rows that must agree once the cause is undone
FEWEST, SOME = 3, 0.02  # rows, and share of them, that are no accident
ENOUGH_ROWS = 6  # rows that tell a cause
OFFSET_STEPS = 4
ROUGH = 0.05  # [m] that rows agree with a tracker found from a few of them
DRAWN, DRAWS, REFINED = 4, 80, 3
MOST_PLACING = 200  # rows that place a tracker well enough to find a mistake
LEAST_OFFSET = np.deg2rad(0.3)  # a smaller one is left to the fit
NOTHING = Combination(())
UNKNOWN = (
    "Check the arm of the cell, units, joint order and signs, the tool and the frame "
    "(measurements.frame)"
)

ErrorOf = Callable[[States], Floats]


@dataclass(frozen=True)
class Guess:
    """A mistake that people make, undone.

    Attributes:
        all_rows: What is wrong and the cure, where it is in all rows.
        look: What some rows look like, a verb with its object.
        cure: What to do where some rows do.
        states: Mended states, n rows.
        position: Mended positions, (n, 3) [m], NaN where there is none.
    """

    all_rows: str
    look: str
    cure: str
    states: States
    position: Floats


@dataclass(frozen=True, eq=False)
class Cause:
    """The mistake that explains rows.

    Attributes:
        guess: The mistake.
        rows: Rows that have it, (n,).
        place: Which rows they are: "all", "from", "until" or "some".
    """

    guess: Guess
    rows: Bools
    place: str

    @property
    def first(self) -> int:
        """Number of the first row that has it."""
        return int(np.argmax(self.rows))

    def problem(self, survey: Measurements) -> str:
        """Say which rows look like what."""
        ids = survey.ids
        last = ids[len(self.rows) - 1 - int(np.argmax(self.rows[::-1]))]
        where = {
            "from": f", from row {ids[self.first]} on,",
            "until": f", until row {last},",
        }
        count = f"{int(self.rows.sum())} of {len(self.rows)} rows"
        return f"{count}{where.get(self.place, '')} {self.guess.look}"


def find_cause(
    survey: Measurements,
    arm: Arm,
    error: ErrorOf,
    placed: Registration | None = None,
) -> Cause | None:
    """Find the mistake that explains rows in a known frame; None where none does.

    Args:
        survey: The rows.
        arm: The arm.
        error: What is known of its error, (n, 3) [m] for n states.
        placed: The tracker's place, None where positions are in the base frame.
    """
    states, position = survey.states, survey.position

    def in_base(position: Floats) -> Floats:
        return position if placed is None else placed.to_base(position)

    before = _residual_lengths(arm, states, in_base(position), error)
    bad = before > CLOSE
    few = max(FEWEST, SOME * len(before))
    if len(before) < ENOUGH_ROWS or bad.sum() < few:
        return None
    found: list[tuple[float, int, Cause]] = []
    guesses = chain(
        _guesses(states, position),
        (
            guess_offset(states, position, j, by)
            for j in range(6)
            if abs(by := _offset(arm, states[bad], in_base(position)[bad], error, j))
            > LEAST_OFFSET
        ),
    )
    for guess in guesses:
        after = _residual_lengths(arm, guess.states, in_base(guess.position), error)
        shown = _explanation(before, np.where(np.isnan(after), np.inf, after))
        if shown is not None:
            share, rank, rows, place = shown
            found.append((share, rank, Cause(guess, rows, place)))
    if not found:
        return None
    best = max(share for share, _, _ in found)
    near = [f for f in found if f[0] > best - SOME]
    return min(near, key=lambda f: f[1])[2]


def _residual_lengths(
    arm: Arm, states: States, position: Floats, error: ErrorOf
) -> Floats:
    """Return by how much positions differ from those expected, (n,) [m]."""
    expected = ArmStates(arm, states).walk.tcp + error(states)
    return np.asarray(np.linalg.norm(position - expected, axis=1))


def _explanation(before: Floats, after: Floats) -> tuple[float, int, Bools, str] | None:
    """Say which rows a guess explains, if it does: all, from one on, until one, some.

    Args:
        before: Distances as the rows are, (n,) [m].
        after: Distances with the guess undone, (n,) [m].

    Returns:
        Share of the rows that agree, rank of the form, the rows, the form.
    """
    n, good, mended = len(before), before < CLOSE, after < CLOSE
    changed = mended & ~good
    few = max(FEWEST, SOME * n)
    better = np.median(before) > BETTER * np.median(after)
    if better and np.median(after) < CLOSE and good.mean() < SOME:
        return float(mended.mean()), 0, np.ones(n, dtype=bool), "all"
    if changed.sum() < few or changed.sum() < EXPLAINED * (~good).sum() - 1:
        return None
    if np.median(before[changed]) < BETTER * np.median(after[changed]):
        return None
    behind = np.arange(n)
    ahead = np.concatenate([[0], np.cumsum(good)])
    rest = np.concatenate([np.cumsum(mended[::-1])[::-1], [0]])
    first = int(np.argmax(ahead + rest))
    first += int(np.argmax(~good[first:])) if first < n else 0
    as_all = float(mended.mean())
    if as_all >= EXPLAINED and as_all > (ahead + rest).max() / n - SOME:
        return as_all, 0, np.ones(n, dtype=bool), "all"
    lead = np.concatenate([[0], np.cumsum(mended)])
    tail = np.concatenate([np.cumsum(good[::-1])[::-1], [0]])
    last = n - int(np.argmax((lead + tail)[::-1]))
    last -= int(np.argmax(~good[:last][::-1])) if last else 0
    for rank, place, rows in (
        (1, "from", behind >= first),
        (2, "until", behind < last),
        (3, "some", changed),
    ):
        share = float(np.where(rows, mended, good).mean())
        if share >= EXPLAINED and (changed & rows).sum() >= few:
            return share, rank, rows, place
    return None


def _guesses(states: States, position: Floats) -> Iterator[Guess]:
    """List mistakes that rows may have, most frequent first, each undone."""
    yield from _guess_units(states, position)
    yield from _guess_rows(states, position)
    yield from _guess_columns(states, position)


def _guess_units(states: States, position: Floats) -> Iterator[Guess]:
    yield Guess(
        "The positions look like metres: write millimetres (of points: "
        "--set measurements.unit=m)",
        "look like metres",
        "The others are in millimetres: write all of them so", states, position * 1e3,
    )  # fmt: skip
    yield Guess(
        "The positions look like inches: write millimetres (of points: "
        "--set measurements.unit=inch)",
        "look like inches",
        "The others are in millimetres: write all of them so", states, position * 25.4,
    )  # fmt: skip
    yield Guess(
        "The joint angles look like radians: write degrees",
        "have joint angles that look like radians",
        "The others are in degrees: write all of them so",
        states.with_(q=np.rad2deg(states.q)), position,
    )  # fmt: skip


def _guess_rows(states: States, position: Floats) -> Iterator[Guess]:
    """Guess that positions stand one row above or below their own."""
    for name, step, move in (("next", 1, "down"), ("previous", -1, "up")):
        shifted = np.full_like(position, np.nan)
        if step > 0:
            shifted[1:] = position[:-1]
        else:
            shifted[:-1] = position[1:]
        lost = "was missed" if step > 0 else "was written twice"
        yield Guess(
            f"Every row holds the position of the {name} one: move the positions "
            f"{move} by one row",
            f"hold the position of the {name} one: a reading {lost}",
            f"Move their positions {move} by one row, and remove the row without one",
            states, shifted,
        )  # fmt: skip


def _guess_columns(states: States, position: Floats) -> Iterator[Guess]:
    """Guess signs and order of the joints."""
    q = states.q
    for j in range(6):
        sign = np.where(np.arange(6) == j, -1.0, 1.0)
        yield Guess(
            f"Joint {j + 1} looks like it has the other sign",
            f"look like joint {j + 1} has the other sign", "Correct the column",
            states.with_(q=q * sign), position,
        )  # fmt: skip
    for i, j in combinations(range(6), 2):
        order = np.arange(6)
        order[[i, j]] = j, i
        yield Guess(
            f"Joints {i + 1} and {j + 1} look swapped: correct the columns",
            f"look like joints {i + 1} and {j + 1} are swapped", "Correct the columns",
            states.with_(q=q[:, order]), position,
        )  # fmt: skip


def guess_offset(states: States, position: Floats, joint: int, by: float) -> Guess:
    """Undo that a joint is off by an angle [rad]."""
    deg = f"{np.rad2deg(by):+.2f} deg"
    return Guess(
        f"Joint {joint + 1} looks off by {deg}: correct its zero (mastering), or its "
        "angles in the file",
        f"look like joint {joint + 1} is off by {deg}",
        "Correct the joint's zero (mastering), or fit these rows by themselves",
        states.with_(q=states.q + by * np.eye(6)[joint]), position,
    )  # fmt: skip


def _offset(
    arm: Arm, states: States, position: Floats, error: ErrorOf, joint: int
) -> float:
    """Fit by how much the angle of one joint is off, robustly [rad]."""
    by = 0.0
    for _ in range(OFFSET_STEPS):
        q = states.q + by * np.eye(6)[joint]
        batch = ArmStates(arm, states.with_(q=q))
        gap = position - batch.walk.tcp - error(batch.states)
        column = batch.jacobian[:, :, joint]
        lever = np.maximum((column**2).sum(axis=1), 1e-9)
        by += float(np.median((column * gap).sum(axis=1) / lever))
    return by


# Mistakes of all rows, in any frame.


def cause_in_any_frame(survey: Measurements, arm: Arm) -> str:
    """Name the mistake that explains all positions in a frame that is unknown."""
    some = np.unique(np.linspace(0, len(survey) - 1, TRIED).astype(np.int64))
    states, position, names = survey.states, survey.position, survey.stations

    def gap(states: States, position: Floats) -> float:
        found = register(arm, states, position, NOTHING, np.zeros(0), names)
        return typical_gap(found, arm, states, position)

    if gap(states[some], position[some]) < CLOSE:
        return (
            "The positions look like the tracker's frame: use "
            "--set measurements.frame=tracker"
        )
    offsets = (
        guess_offset(states, position, j, _offset_in_any_frame(survey[some], arm, j))
        for j in range(1, 5)  # the frame and the probe hold those of joints 1 and 6
    )
    for guess in chain(_guesses(states, position), offsets):
        rows = some[~np.isnan(guess.position[some]).any(axis=1)]
        if gap(guess.states[rows], guess.position[rows]) < CLOSE:
            return guess.all_rows
    return UNKNOWN


def _offset_in_any_frame(survey: Measurements, arm: Arm, joint: int) -> float:
    """Fit by how much one joint is off, beside the tracker and the probe [rad]."""
    by, states = 0.0, survey.states
    for _ in range(2 * OFFSET_STEPS):
        turned = states.with_(q=states.q + by * np.eye(6)[joint])
        found = register(
            arm, turned, survey.position, NOTHING, np.zeros(0), survey.stations
        )
        batch = ArmStates(arm, found.on_probes(turned))
        gap = found.to_base(survey.position, states.station) - batch.walk.tcp
        beside = Placement.propose(arm, states).columns(batch)
        columns = np.concatenate([batch.jacobian[:, :, [joint]], beside], axis=2)
        rows = columns.reshape(-1, columns.shape[2])
        by += float(np.linalg.lstsq(rows, gap.reshape(-1))[0][0])
    return by


def find_cause_in_tracker_frame(survey: Measurements, arm: Arm) -> Cause | None:
    """Find the mistake that some rows of one station have, or None.

    The tracker is found from the rows that agree with a few of them.
    """
    if len(survey) < ENOUGH_ROWS:
        return None
    placed = _place(survey, arm, np.ones(len(survey), dtype=bool))
    few = max(FEWEST, SOME * len(survey))
    if (_gap(survey, arm, placed) > CLOSE).sum() < few:
        return None
    found: Cause | None = None
    most = 0
    for rows in _subsets(len(survey)):
        used = np.isin(np.arange(len(survey)), rows)
        for _ in range(REFINED):
            placed = _place(survey, arm, used)
            used = _gap(survey, arm, placed) < ROUGH
            if used.sum() < ENOUGH_ROWS:
                break
        good = int((_gap(survey, arm, placed) < CLOSE).sum())
        if used.sum() < ENOUGH_ROWS or good <= most:
            continue
        states = placed.on_probes(survey.states)
        cause = find_cause(survey.with_states(states), arm, no_error, placed)
        if cause is not None:
            found, most = cause, good
            if good > len(survey) / 2:
                break
    return found


def find_moved_tracker(survey: Measurements, arm: Arm) -> int | None:
    """Find the row from which on the tracker of one station stood elsewhere.

    Args:
        survey: Rows of one station, in its frame.
        arm: The arm.

    Returns:
        Number of the first row, None where the rows are not those of two places.
    """
    n = len(survey)
    for known in (slice(0, n // 3), slice(n - n // 3, n)):
        used = np.zeros(n, dtype=bool)
        used[known] = True
        if used.sum() < ENOUGH_ROWS:
            return None
        good = _gap(survey, arm, _place(survey, arm, used)) < CLOSE
        early = good if known.start == 0 else ~good
        seen = np.concatenate([[0], np.cumsum(np.where(early, 1, -1))])
        first = int(np.argmax(seen))
        behind = np.arange(n) >= first
        if min(first, n - first) < ENOUGH_ROWS:
            continue
        gaps = [_gap(survey[p], arm, _place(survey, arm, p)) for p in (~behind, behind)]
        if all(np.median(gap) < CLOSE for gap in gaps):
            return first
    return None


def _subsets(n: int) -> Iterator[NDArray[np.int64]]:
    """Draw rows of which some hold no mistake: thirds in order, then a few each."""
    yield from np.array_split(np.arange(n), 3)
    rng = np.random.default_rng(0)
    for _ in range(DRAWS):
        yield rng.choice(n, DRAWN, replace=False)


def _place(survey: Measurements, arm: Arm, rows: Bools) -> Registration:
    """Find the tracker from some rows, at most a few hundred of them."""
    chosen = np.flatnonzero(rows)
    some = np.linspace(0, len(chosen) - 1, min(len(chosen), MOST_PLACING))
    chosen = chosen[some.astype(np.int64)]
    states, position = survey.states[chosen], survey.position[chosen]
    placed = register(arm, states, position, NOTHING, np.zeros(0))
    if len(placed.tool_ids) == len(np.unique(survey.states.tool_id)):
        return placed
    every, first = np.unique(survey.states.tool_id, return_index=True)
    probes = survey.states.tool[first].copy()
    probes[np.searchsorted(every, placed.tool_ids)] = placed.probes
    return Registration(placed.transforms, probes, every)


def _gap(survey: Measurements, arm: Arm, placed: Registration) -> Floats:
    """Return what a registration leaves of the nominal arm, (n,) [m]."""
    tcp = ArmStates(arm, placed.on_probes(survey.states)).walk.tcp
    return np.asarray(np.linalg.norm(placed.to_base(survey.position) - tcp, axis=1))


def no_error(states: States) -> Floats:
    """Return no error, (n, 3) [m]."""
    return np.zeros((len(states), 3))


# Directions that are wrong in all rows, against a model that knows the backlash.

NEAR_ONE = 0.2  # by which the share of a wrong direction may miss 1
CERTAIN = 6.0  # standard errors that a joint's must stand above 0 to count
LESS = 0.7  # of the median residual may be left


def wrong_directions(survey: Measurements, arm: Arm, model: Model) -> str | None:
    """Say what is wrong with the lambda columns of all rows, None where nothing is.

    The readings differ from those predicted by what the model predicts for the mended
    directions less what it predicts for the file's, times 1.

    Args:
        survey: The rows, base frame.
        arm: The arm.
        model: A model that knows the backlash.
    """
    states = survey.states
    if survey.inferred.all() or len(states) < ENOUGH_ROWS:
        return None
    predicted = model.error(arm, states)
    read = survey.position - ArmStates(arm, states).walk.tcp
    y = _beside_setup(read - predicted, arm, states)
    best, text_of_best = LESS * float(np.median(np.linalg.norm(y, axis=1))), None
    for text, side in _other_directions(states.direction):
        changes = []
        for j in range(6):
            one = np.where(np.arange(6) == j, side, states.direction)
            change = model.error(arm, states.with_(direction=one)) - predicted
            changes.append(_beside_setup(change, arm, states))
        columns = np.stack(changes, axis=2)
        rest = float(np.median(np.linalg.norm(y - columns.sum(axis=2), axis=1)))
        if rest < best and _all_together(columns, y):
            best, text_of_best = rest, text
    return text_of_best


def _all_together(columns: Floats, y: Floats) -> bool:
    """Return True if the directions of all joints that tell are wrong as guessed.

    Args:
        columns: What a wrong direction of each joint does, (n, 3, 6) [m].
        y: What is left of the readings, (n, 3) [m].
    """
    root = np.sqrt(robust_weights(y - columns.sum(axis=2)))[:, None]
    rows, target = (columns * root[:, :, None]).reshape(-1, 6), (y * root).reshape(-1)
    share = np.linalg.lstsq(rows, target)[0]
    rest = target - rows @ share
    variance = float(rest @ rest) / max(len(target) - 12, 1)
    error = np.sqrt(np.maximum(np.diag(np.linalg.pinv(rows.T @ rows)), 0.0) * variance)
    shown = (np.linalg.norm(rows, axis=0) > 0) & (CERTAIN * error < 1.0)
    off = np.abs(share - 1.0)
    near = off < np.maximum(NEAR_ONE, 4.0 * error)
    return bool(shown.sum() >= 2 and near[shown].all())


def _other_directions(side: Floats) -> Iterator[tuple[str, Floats]]:
    """List mistakes in all lambda columns, undone: text and directions, (n, 6)."""
    yield "lambda has the other sign in every row: write 1 for motion forward", -side
    yield "the lambda columns stand in reverse order", side[:, ::-1]
    for i, j in combinations(range(6), 2):
        order = np.arange(6)
        order[[i, j]] = j, i
        yield f"lambda{i + 1} and lambda{j + 1} look swapped", side[:, order]
    for shift in range(1, 6):
        moved = np.roll(side, shift, axis=1)
        yield f"the lambda columns are shifted by {shift}", moved


def _beside_setup(error: Floats, arm: Arm, states: States) -> Floats:
    """Leave out what a shift and a turn of the base explain, (n, 3) [m]."""
    rigid = rigid_motions(ArmStates(arm, states).walk.tcp).reshape(-1, 6)
    flat = error.reshape(-1)
    return np.asarray(flat - rigid @ np.linalg.lstsq(rigid, flat)[0]).reshape(-1, 3)
