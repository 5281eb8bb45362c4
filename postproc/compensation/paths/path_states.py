"""A program along its ways: where each joint lies in its play, and the error there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Bools, Floats, Ints, any_in_rows
from postproc.compensation.paths.path_samples import PathSamples
from postproc.model.backlash_width import half_widths, on_the_way
from postproc.model.effect_sum import Combination
from postproc.model.flank_hypotheses import flanks_of, nominal_widths
from postproc.model.model import Model
from postproc.model.variance import covariance_of
from postproc.motion.cycle_time import ProgramCycle
from postproc.robot.backlash_operator import PlayOperator
from postproc.robot.cell import Cell
from postproc.robot.direction import half_width, sides_along
from postproc.robot.state import make_states
from postproc.robot.trajectory import Motion

FINE = 8  # parts of an interval in which a joint changes its flank
SLOW = 0.2  # of the highest speed of a joint: so fast surveys move, and links rest
CHANGED = 0.02  # of half the play: less between two samples is looked at no closer
RESTS = 0.999  # of half the play: a link that lies there rests on its flank


@dataclass(frozen=True)
class AlongWays:
    """A program along its ways.

    Attributes:
        cycle: The program.
        ways: Its ways.
        half: Half of the joints' gaps, (s, 6) [rad].
        least, most: Sides of the joints' plays, see `sides_along`, (s, 6) each.
    """

    cycle: ProgramCycle
    ways: PathSamples
    half: Floats
    least: Floats
    most: Floats

    @classmethod
    def of(
        cls, cell: Cell, model: Model, cycle: ProgramCycle, ways: PathSamples,
        half: Floats | None = None,
    ) -> AlongWays:  # fmt: skip
        """Follow the joints' plays along the ways, each as wide as its gap there.

        What is known of them where a way begins is what the way before it leaves, where
        one leads there.

        Args:
            cell: The arm, its play as wide as its gaps.
            model: The arm's error.
            cycle: The program.
            ways: Its ways.
            half: Half of the joints' gaps there, (s, 6) [rad]; None: by the model.
        """
        width = nominal_widths(flanks_of(model, cell.arm))
        if half is None:
            half = half_widths(model, cell.arm, ways.q)
        return cls._follow(cell, cycle, ways, half, width)

    def over(self, cell: Cell, width: Floats) -> AlongWays:
        """Return it if joints go over so many gaps from flank to flank, (6,)."""
        return self._follow(cell, self.cycle, self.ways, self.half, width)

    @classmethod
    def _follow(
        cls, cell: Cell, cycle: ProgramCycle, ways: PathSamples, half: Floats,
        width: Floats,
    ) -> AlongWays:  # fmt: skip
        begins, alone = ways.begins, np.ones(len(ways.visit), dtype=bool)
        alone[1:] = ways.source[1:] != ways.visit[:-1]
        begins[ways.first[:-1]] = alone
        play = cycle.arrived.past.play[ways.source[alone]]
        least, most = sides_along(cell.arm, ways.q, begins, play, width * half)
        least, most = on_the_way(least, width), on_the_way(most, width)
        return cls(cycle, ways, half, least, most)

    def run_on(self, cell: Cell, width: Floats) -> Floats:
        """Return the sides of joints if links ran on at fast stops, (s, 6).

        Where a way begins at such a stop, the link lies on its other flank, and stays
        there until its drive has crossed the gap.

        Args:
            cell: The arm, its play as wide as its gaps.
            width: Gaps over which joints go from flank to flank, (6,).
        """
        ways, arm = self.ways, cell.arm
        fast = find_fast_stops(self.cycle)[ways.source]
        chained = np.append(False, ways.source[1:] == ways.visit[:-1])
        own = ~chained | any_in_rows(fast)
        at = ways.first[:-1][own]
        side = np.where(fast[own], -self.side[at], self.side[at])
        begins = np.zeros(len(ways.q), dtype=bool)
        begins[at] = True
        z = ways.q[at] @ arm.coupling.T - side * half_width(arm)
        play = PlayOperator(z, z)
        sides, _ = sides_along(arm, ways.q, begins, play, width * self.half)
        return on_the_way(sides, width)

    @cached_property
    def side(self) -> Floats:
        """Where each joint lies in its play, the middle of what is known, (s, 6)."""
        return (self.least + self.most) / 2

    def changes(self) -> Bools:
        """Tell behind which samples joints change their flanks, (s, 6)."""
        moved = np.maximum(
            np.abs(np.diff(self.least, axis=0, append=self.least[-1:])),
            np.abs(np.diff(self.most, axis=0, append=self.most[-1:])),
        )
        return np.asarray(moved > CHANGED)

    def arrivals(self) -> Bools:
        """Tell behind which samples joints come to rest on a flank, (s, 6)."""
        rests = np.abs(self.side) >= RESTS
        return self.changes() & np.append(rests[1:], rests[-1:], axis=0)


def find_fast_stops(cycle: ProgramCycle) -> Bools:
    """Return which joints may arrive fast at which visits, (n, 6).

    That is where a JOINT move ends, and its slowest joint sets how fast others turn.
    """
    arm, targets, source = cycle.arm, cycle.targets, cycle.ways[1]
    turned = np.abs((cycle.path.q - cycle.path.q[source]) @ arm.coupling.T)
    lasts = turned / arm.velocity  # [s] at full speed
    longest = np.maximum(lasts.max(axis=1, initial=0.0), 1e-12)
    share = lasts * (targets.override / longest)[:, None]
    stops = (targets.move == Motion.JOINT) & ~targets.fly & (source >= 0)
    return np.asarray(stops[:, None] & (share > SLOW))


@dataclass(frozen=True)
class ErrorAlong:
    """The error of the arm along ways.

    Attributes:
        cell: The arm and its payload.
        model: The arm's error.
        temperature: [deg C], NaN where not known.
    """

    cell: Cell
    model: Model
    temperature: float

    def __call__(self, run: AlongWays, rows: Ints | slice, side: Floats) -> Floats:
        """Predict it at samples (k,) with joints on some sides (k, 6): (k, 3) [m]."""
        ways, targets = run.ways, run.cycle.targets
        visit = ways.visit[ways.way[rows]]
        states = make_states(
            ways.q[rows],
            side,
            targets.tool[visit, :3, 3],
            travel=_travel(run)[rows] if "travel" in self.model.needs else np.nan,
            speed=targets.linear_speed[visit] * targets.override[visit],
            temperature=self.temperature,
            payload=self.cell.payload_mass,
            payload_com=self.cell.payload_com,
        )
        return self.model.error(self.cell.arm, states)

    def hold(self, factor: float) -> Iterator[tuple[int, ErrorAlong]]:
        """Yield joints (from 1), and the error if friction holds other weights there.

        Args:
            factor: How much more than what was fitted.
        """
        effects = self.model.effects.effects
        for k, effect in enumerate(effects):
            other, joint = effect.hold(factor), effect.only_joint()
            if other is not None and joint is not None:
                every = Combination((*effects[:k], other, *effects[k + 1 :]))
                yield joint + 1, replace(self, model=replace(self.model, effects=every))

    def spread(self, run: AlongWays, rows: Ints) -> Floats:
        """Return the covariance of what no effect describes at samples (k,).

        All joints count together, as the fit found that poses err.

        Returns:
            (k, 6) [m^2]: xx, yy, zz, then xy, xz, yz.
        """
        ways, noise = run.ways, self.model.noise
        if not (noise.pose_joint or noise.pose):
            return np.zeros((len(rows), 6))
        tool = run.cycle.targets.tool[ways.visit[ways.way[rows]], :3, 3]
        jacobian = self.cell.arm.jacobian(ways.q[rows], tool)[:, :3]
        return covariance_of(noise.pose_columns(jacobian))


def _travel(run: AlongWays) -> Floats:
    """Travel of every joint since its last reversal, along the ways, (s, 6) [rad]."""
    ways, arrived = run.ways, run.cycle.arrived
    moved = np.diff(ways.q, axis=0, prepend=ways.q[:1])
    sense = np.sign(moved)
    sense[ways.first[:-1]] = arrived.direction[ways.source]
    rows = np.arange(len(sense))[:, None]
    begin = ways.first[ways.way][:, None]
    last = np.maximum.accumulate(np.where(sense != 0, rows, 0), axis=0)
    sense = np.take_along_axis(sense, np.maximum(last, begin), axis=0)
    turned = np.zeros(sense.shape, dtype=bool)
    turned[1:] = sense[1:] != sense[:-1]
    turned[ways.first[:-1]] = False
    since = np.maximum.accumulate(np.where(turned, rows - 1, 0), axis=0)
    here = since >= begin
    place = np.take_along_axis(ways.q, np.maximum(since, begin), axis=0)
    known = np.nan_to_num(arrived.travel[ways.source])[ways.way]
    return np.asarray(np.abs(ways.q - place) + np.where(here, 0.0, known))


def refine_at_reversals(
    cell: Cell,
    model: Model,
    cycles: tuple[ProgramCycle, ...],
    pair: list[PathSamples],
) -> list[PathSamples]:
    """Look closer where a joint changes its flank in one of some programs.

    Once more where it comes to rest: the largest deviation stands there, however fast
    its drive crosses the gap.

    Args:
        cell: The arm, its play as wide as its gaps.
        model: The arm's error.
        cycles: The programs that count; the last ones of those that `pair` is of.
        pair: Ways of programs with as many samples each.
    """
    half = half_widths(model, cell.arm, pair[0].q)  # of all: they differ by corrections
    changes = _find(AlongWays.changes, cell, model, cycles, pair, half)
    changes |= np.append(changes[1:], False) | np.append(False, changes[:-1])
    pair, half = _refine(pair, half, changes)
    arrivals = _find(AlongWays.arrivals, cell, model, cycles, pair, half)
    return _refine(pair, half, arrivals)[0]


def _find(
    what: Callable[[AlongWays], Bools],
    cell: Cell,
    model: Model,
    cycles: tuple[ProgramCycle, ...],
    pair: list[PathSamples],
    half: Floats,
) -> Bools:
    """Tell behind which samples something is so for any joint of the programs, (s,)."""
    found = np.zeros(len(half), dtype=bool)
    for cycle, ways in zip(cycles, pair[-len(cycles) :], strict=True):
        run = AlongWays.of(cell, model, cycle, ways, half)
        found |= any_in_rows(what(run))
    return found


def _refine(
    pair: list[PathSamples], half: Floats, rows: Bools
) -> tuple[list[PathSamples], Floats]:
    """Cut what follows some samples (s,) of ways into `FINE` parts; gaps go evenly."""
    rows &= ~np.append(pair[0].begins[1:], True)
    at = np.flatnonzero(rows)
    after = np.repeat(at, FINE - 1)
    share = np.tile(np.arange(1, FINE) / FINE, len(at))
    u = share[:, None]
    new = (1 - u) * half[after] + u * half[after + 1]
    finer = np.insert(half, after + 1, new, axis=0)
    return [ways.refine(after, share) for ways in pair], finer
