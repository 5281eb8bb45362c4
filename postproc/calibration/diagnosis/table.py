"""The table of causes: every part that may move, by everything that may drive it.

Named effects are cells of it that somebody has thought of. The others are searched all
the same: for one driver and law the columns of all carriers are the carrier's own
direction times one function of the rows, so that functions are evaluated once, and
scored in blocks.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from postproc.arrays import Floats, Ints, isin_sorted
from postproc.calibration.diagnosis.candidates import (
    JointAxes,
    Library,
    Projection,
    View,
    reduce_columns,
)
from postproc.calibration.diagnosis.model_update import revises
from postproc.calibration.diagnosis.score import (
    Null,
    Score,
    draws,
    family_maxima,
    log_evidence,
    rank_some,
)
from postproc.calibration.regression import Fit
from postproc.model.carrier import Carrier, every_carrier
from postproc.model.covariate import (
    JOINTS,
    PLAIN,
    covariate,
    varies,
    varies_enough,
)
from postproc.model.effects import EFFECTS
from postproc.model.effects.curve import Curve
from postproc.model.effects.effect import FREE, PART_MOTION, Candidate, Family
from postproc.model.effects.part_motion import (
    LOADS,
    PASSING,
    PLACED,
    STEPS,
    PartMotion,
    family_of,
)
from postproc.model.kinematics import ArmStates

ORDERS = 8  # waves per turn of an angle's harmonics that are tried
PLAINER = 3.0  # nats that a law may be behind one with more columns: odds of 20 to 1
WIDTHS = (0.1, 0.3, 0.9)  # of bends, in parts of half a range
FEW_VALUES = 5  # of a driver: what lies between them shows no bend
LIKELY = 0.25  # part of all families that are looked at closely
NARROW = 60  # families that a search weighs once it has seen all
TOLD = 10  # families whose scores are told
NONE = np.zeros(0, dtype=np.int64)
MANY = 6000  # rows: of more, products would take gigabytes and minutes
OTHER = "other "  # before the name of a factor that is another joint's
OTHER_ORDERS = 4  # waves per turn of an angle that such a factor multiplies
LEAST_MOMENT = 1.0  # [N m] by which a load varies that may bend anything


@dataclass(frozen=True, eq=False)
class MotionLaw:
    """A function of the rows, as an effect of the first joint.

    Attributes:
        effect: The effect, of any carrier.
        log_prior: Log of its share of what its driver may do.
    """

    effect: PartMotion | Curve
    log_prior: float

    @cached_property
    def cell(self) -> tuple[str, str]:
        """Name its driver and its law, a harmonic without its order."""
        law = "curve" if isinstance(self.effect, Curve) else self.effect.law
        return self.driver, law.partition(" ")[0]

    @cached_property
    def columns(self) -> int:
        """Count its columns."""
        return len(self.effect.parameters())

    @cached_property
    def driver(self) -> str:
        """Name what drives it, the factor first."""
        source = self.effect.source
        source = source if isinstance(source, str) else source[0]
        factor = self.effect.factor
        return f"{factor} x {source}" if factor else source

    def on(self, carrier: Carrier, loose: bool) -> Candidate:
        """Make the candidate that a carrier moves by it.

        Args:
            carrier: The carrier.
            loose: Whether a model is given that may have its mean otherwise.
        """
        family = family_of(carrier, self.driver)
        more = loose and carrier.joint is None
        effect = replace(self.effect, direction=str(carrier), loose=more)
        return Candidate(family, effect, self.driver, self.log_prior)


@dataclass(frozen=True, eq=False)
class MotionLaws:
    """MotionLaws of one factor.

    Attributes:
        drivers: Names of what drives them, (d,).
        widths: Those of one number of columns k: the laws (c), their functions over
            prior scales, (c, k, n), and which of the drivers each has, (c,).
    """

    drivers: tuple[str, ...]
    widths: tuple[tuple[tuple[MotionLaw, ...], Floats, Ints], ...]

    @classmethod
    def of(
        cls,
        batch: ArmStates,
        drivers: Sequence[str],
        factor: str,
        laws_of: LawsOf | None = None,
    ) -> MotionLaws:
        """Evaluate laws of some drivers, multiplied by a factor if there is one.

        Args:
            batch: The rows.
            drivers: Names of the drivers.
            factor: What multiplies them, or "".
            laws_of: Lists the laws of one; all by default.
        """
        alike: dict[int, list[tuple[MotionLaw, Floats, int]]] = defaultdict(list)
        for k, driver in enumerate(drivers):
            for law in (laws_of or _laws_of)(batch, driver, factor):
                scale = np.array([p.scale for p in law.effect.parameters()])
                values: Floats = (law.effect.turning(batch) * (scale / scale.max())).T
                alike[values.shape[0]].append((law, values, k))
        widths = []
        for _, some in sorted(alike.items()):
            laws = tuple(law for law, _, _ in some)
            values = np.stack([v for _, v, _ in some])
            widths.append((laws, values, np.array([which for _, _, which in some])))
        names = (f"{factor} x {d}" if factor else d for d in drivers)
        return cls(tuple(names), tuple(widths))

    def along(self, axes: JointAxes, rest: Floats) -> Floats:
        """Ask how much of a residual the columns of each driver have at most, (d,).

        Args:
            axes: A carrier's.
            rest: The residual along them, filtered twice, (n,).
        """
        most = np.zeros(len(self.drivers))
        for _, values, which in self.widths:
            white = axes.size.apply(values)
            size = np.maximum(np.einsum("ckn,ckn->ck", white, white), 1e-300)
            share = ((white @ rest) ** 2 / size).max(axis=1)
            np.maximum.at(most, which, share)
        return most

    def some(self, drivers: Ints) -> MotionLaws:
        """Return the laws of some of the drivers, by their numbers."""
        widths = []
        for laws, values, which in self.widths:
            kept = np.flatnonzero(isin_sorted(which, drivers))
            if len(kept):
                own = tuple(laws[k] for k in kept)
                widths.append((own, values[kept], which[kept]))
        return replace(self, widths=tuple(widths))

    def at_rows(self, rows: Ints) -> MotionLaws:
        """Return them at some of the rows."""
        widths = tuple((law, v[:, :, rows], which) for law, v, which in self.widths)
        return replace(self, widths=widths)


NO_LAWS = MotionLaws((), ())
LawsOf = Callable[[ArmStates, str, str], list[MotionLaw]]


@dataclass(frozen=True, eq=False)
class MotionFamily:
    """A carrier and a driver, scored.

    Attributes:
        evidence: Of all its laws together [nats].
        carrier: What moves.
        factor: What multiplies the driver, or "".
        driver: Number of the driver among those of its laws.
        laws: Laws of the factor.
        each: Evidence of these by width, with their shares, (c, 1) each.
    """

    evidence: float
    carrier: Carrier
    factor: str
    driver: int
    laws: MotionLaws
    each: tuple[Floats, ...]

    def plainest(self) -> MotionLaw:
        """Take the law with the fewest columns of those that explain as much."""
        own = self._own()
        least = max(e for e, _ in own) - PLAINER
        alike = [x for x in own if x[0] >= least]
        return min(alike, key=lambda x: (x[1].columns, -x[0]))[1]

    def find_located_law(self) -> MotionLaw | None:
        """Take the best of the laws that have a place, None where there is none."""
        own = [x for x in self._own() if x[1].cell[1] in PLACED]
        return max(own, key=lambda x: x[0])[1] if own else None

    def _own(self) -> list[tuple[float, MotionLaw]]:
        """List the laws of the driver, and the evidence of each."""
        return [
            (float(e[i, 0]), law)
            for e, (some, _, which) in zip(self.each, self.laws.widths, strict=True)
            for i, law in enumerate(some)
            if which[i] == self.driver
        ]


@dataclass(frozen=True, eq=False)
class Table:
    """All cells that rows can show and that have no name.

    Attributes:
        revised: Whether rows revise a given model, which may have means otherwise.
        laws: Laws by the factor that multiplies them, "" without one. Those of another
            joint's direction and load are few, see `OTHER`.
        named: (driver, law) of cells that named effects are, by carrier.
        only: Numbers of the drivers that are tried, by carrier and factor; None: all.
    """

    revised: bool
    laws: dict[str, MotionLaws]
    named: dict[str, frozenset[tuple[str, str]]]
    only: dict[tuple[Carrier, str], Ints] | None = None

    @classmethod
    def of(cls, fit: Fit, without: Collection[str] = ()) -> Table:
        """List what may drive anything in the rows of a fit.

        Args:
            fit: The fit.
            without: Names of effects that are known not to be there.
        """
        batch = fit.combination.at(fit.batch, fit.values)
        drivers = _drivers(batch)
        if "tracker_drift" in without:
            drivers = [d for d in drivers if d not in PASSING]
        factors = [f"lambda {j}" for j in JOINTS if f"lambda {j}" in drivers]
        factors += [f"torque {j}" for j in JOINTS if f"torque {j}" in drivers]
        laws = {"": MotionLaws.of(batch, drivers, "")}
        for factor in factors if len(batch) <= MANY else ():
            # With which drivers a factor is a cause of its own.
            kinds = {d.partition(" ")[0] for d in drivers}
            if factor.startswith("lambda"):
                kinds -= {"lambda", *PASSING}
            else:
                kinds &= {"joint", "temperature", "way"}
            other = [d for d in drivers if d.partition(" ")[0] in kinds]
            laws[factor] = MotionLaws.of(batch, other, factor)
            turns = [d for d in drivers if d.startswith("joint")]
            laws[OTHER + factor] = MotionLaws.of(batch, turns, factor, _waves_of)
        named: dict[str, set[tuple[str, str]]] = defaultdict(set)
        for kind in EFFECTS:
            for carrier, *cell in kind.cells:
                named[carrier].add((cell[0], cell[1]))
        return cls(
            revises(fit), laws, {k: frozenset(cells) for k, cells in named.items()}
        )

    def at_rows(self, rows: Ints) -> Table:
        """Return the table of some of the rows."""
        return replace(self, laws={f: x.at_rows(rows) for f, x in self.laws.items()})

    def scores(self, view_of: Callable[[Carrier], Projection]) -> list[Score]:
        """Score all cells and return the best, settings as in the table.

        Args:
            view_of: Gives the fit as it is seen along a carrier, with what holds the
                mean of its motion.
        """
        best = self._scan(view_of)[:TOLD]
        return [self._score(view_of(family.carrier), family) for family in best]

    def narrow(self, view_of: Callable[[Carrier], Projection], before: Table) -> Table:
        """Return the table of the best families alone, and of those of another one.

        A search goes through the whole table where it looks for a further effect. What
        it weighs then is one of the best.

        Args:
            view_of: As in `scores`.
            before: A narrowed table, or this one.
        """
        only = dict(before.only or {})
        best = self._likely(view_of)._scan(view_of)[:NARROW]
        for family in best:
            at = family.carrier, family.factor
            only[at] = np.union1d(only.get(at, NONE), [family.driver])
        return replace(self, only=only)

    def _likely(self, view_of: Callable[[Carrier], Projection]) -> Table:
        """Return the table of the families that what is left goes along with most.

        What the model takes up of a column is not asked for: it is never more than a
        column has, so that what it leaves of one explains at least as much.
        """
        asked: list[tuple[Carrier, str, Floats]] = []
        for carrier in every_carrier():
            view = view_of(carrier)
            axes = JointAxes.of(view.fit, carrier.move(view.at))
            rest = axes.along(view.twice)[:, 0]
            for factor in _factors(carrier):
                if factor in self.laws:
                    along = self.laws[factor].along(axes, rest)
                    asked.append((carrier, factor, along))
        least = np.quantile(np.concatenate([x for *_, x in asked]), 1.0 - LIKELY)
        kept = {(c, f): np.flatnonzero(x >= least) for c, f, x in asked}
        return replace(self, only={at: k for at, k in kept.items() if len(k)})

    def _scan(self, view_of: Callable[[Carrier], Projection]) -> list[MotionFamily]:
        """Score the families that anything speaks for, the best first."""
        found = []
        only = None if self.only is None else {carrier for carrier, _ in self.only}
        for carrier in every_carrier():
            if only is not None and carrier not in only:
                continue
            view = view_of(carrier)
            square = np.array([view.rest @ view.rest])
            scored = self._evidence(view, carrier, view.twice, square)
            for factor, laws, each in scored:
                whole = _by_driver(laws, [e[:, 0] for e in each])
                found += [
                    MotionFamily(float(whole[k]), carrier, factor, int(k), laws, each)
                    for k in np.flatnonzero(whole > 0.0)
                ]
        return sorted(found, key=lambda family: -family.evidence)

    def score_moved_parts(self, projection: Projection) -> list[Score]:
        """Score parts that have moved once since a given model was made."""
        if not self.revised:
            return []
        still = [
            Candidate(
                Family(PART_MOTION, None, None, FREE, str(c)), cell, "joint 1", 0.0
            )
            for c in every_carrier()
            if c.part == "link"
            for cell in [PartMotion(str(c), law="constant")]
        ]
        return rank_some(projection, still, without=frozenset(projection.names))

    def _score(self, view: Projection, family: MotionFamily) -> Score:
        """Put a family and its plainest law into a score."""
        loose = self.revised and not holds_mean(view, family.carrier)
        plain = family.plainest()
        candidate = plain.on(family.carrier, loose)
        placed = family.find_located_law() if isinstance(plain.effect, Curve) else None
        law = None if placed is None else placed.on(family.carrier, loose)
        score = rank_some(view, [candidate])[0]
        return replace(score, evidence=family.evidence, law=law)

    def maxima(self, projection: Projection, rows: Floats, square: Floats) -> Floats:
        """Return the largest evidence of any cell for every draw, (draws,).

        Args:
            projection: The fit.
            rows: Draws, (3 n, draws), filtered once.
            square: |z|^2 of every draw, (draws,).
        """
        twice = projection.again(rows)
        best = np.zeros(rows.shape[1])
        for carrier in every_carrier():
            scored = self._evidence(projection, carrier, twice, square)
            for _, laws, each in scored:
                np.maximum(best, _by_driver(laws, each).max(axis=0), out=best)
        return best

    def _evidence(
        self, view: Projection, carrier: Carrier, rows: Floats, square: Floats
    ) -> Iterator[tuple[str, MotionLaws, tuple[Floats, ...]]]:
        """Score all laws of a carrier against rows filtered twice, (3 n, draws).

        Yields:
            A factor, its laws, and by width their evidence and share, (c, draws).
        """
        axes = JointAxes.of(view.fit, carrier.move(view.at))
        along = View(axes.size, axes.along(view.squares), axes.along(rows))
        for factor in _factors(carrier):
            laws, each = self._laws_on(carrier, factor), []
            for some, values, _ in laws.widths:
                reduced = reduce_columns(along, (), axes.size.apply(values))
                evidence = log_evidence(reduced, square, view.rows)
                evidence += self._shares(carrier, some)[:, None]
                each.append(evidence)
            if each:
                yield factor, laws, tuple(each)

    def _laws_on(self, carrier: Carrier, factor: str) -> MotionLaws:
        """Return the laws of a factor that are tried on a carrier."""
        laws = self.laws.get(factor, NO_LAWS)
        if self.only is None:
            return laws
        drivers = self.only.get((carrier, factor), NONE)
        return laws.some(drivers) if len(drivers) else NO_LAWS

    def _shares(self, carrier: Carrier, laws: Sequence[MotionLaw]) -> Floats:
        """Return log shares of laws on a carrier, (c,); -inf of those with a name."""
        named = self.named.get(str(carrier), frozenset())
        return np.array(
            [-np.inf if law.cell in named else law.log_prior for law in laws]
        )


def holds_mean(projection: Projection, carrier: Carrier) -> bool:
    """Tell whether a filter takes out a constant motion of a carrier for a cell."""
    begins = tuple(f"{kind}.{carrier} by " for kind in (PartMotion.name, Curve.name))
    mean = [n for n in projection.names if n.endswith((" mean", " constant"))]
    return any(n.startswith(begins) for n in mean)


def free_carrier(projection: Projection, moved: Carrier) -> Projection:
    """Return a filter that takes a constant motion of a carrier out of the rows too."""
    if holds_mean(projection, moved):
        return projection
    return projection.beside(projection.fit.whiten(moved.move(projection.at)))


def _factors(carrier: Carrier) -> tuple[str, ...]:
    """Name what may multiply a cause at a carrier: its own joint's, and others'."""
    own = min(carrier.link, len(JOINTS))
    kinds = ("lambda", "torque")
    others = (f"{OTHER}{kind} {j}" for kind in kinds for j in JOINTS if j != own)
    return ("", f"lambda {own}", f"torque {own}", *others)


def _by_driver(laws: MotionLaws, each: Sequence[Floats]) -> Floats:
    """Sum the evidence of all laws of each driver, (d,) or (d, draws) [nats]."""
    total = np.full((len(laws.drivers), *each[0].shape[1:]), -np.inf)
    for evidence, (_, _, which) in zip(each, laws.widths, strict=True):
        np.logaddexp.at(total, which, evidence)
    return total


# What may drive, and how.


def _drivers(batch: ArmStates) -> list[str]:
    """Name what varies over the rows and may drive a motion."""
    names = [f"{kind} {j}" for kind in ("joint", "lambda", "way") for j in JOINTS]
    names += [f"torque {j}" for j in JOINTS]
    names += [f"moment {j}{a}" for j in JOINTS[1:] for a in "xy"]
    names += PLAIN
    if varies(covariate(batch, "time")):
        names.remove("order")  # they tell the same
    drivers = []
    for name in names:
        x = covariate(batch, name)
        enough = varies_enough(batch.states, name.partition(" ")[0])
        if name.startswith(LOADS):
            enough = float(np.ptp(x)) > LEAST_MOMENT
        if enough and varies(x):
            drivers.append(name)
    return drivers


def _laws_of(batch: ArmStates, driver: str, factor: str) -> list[MotionLaw]:
    """List the laws that a driver may act by, each kind with the same share."""
    x = covariate(batch, driver)
    low, high = float(x.min()), float(x.max())
    middle, half = (low + high) / 2, (high - low) / 2
    size = float(np.abs(covariate(batch, factor)).max()) if factor else 1.0

    def cell(law: str, at: float = middle, over: float = half) -> PartMotion:
        return PartMotion("joint 1", driver, factor, law, at, over, size)

    kinds: list[list[PartMotion | Curve]] = [[cell("linear")]]
    if not driver.startswith("lambda"):
        places = _places(x, alone=not factor)
        kinds.append([cell("step", at) for at in places])
        if len(np.unique(x)) > FEW_VALUES:
            bends = product(places[::2], WIDTHS)
            kinds.append([cell("saturating", at, w * half) for at, w in bends])
        kinds.append([Curve.over(batch, "joint 1", (driver,), factor, whole=False)])
    if driver.startswith("joint"):
        kinds.append([cell(f"harmonic {n}") for n in range(1, ORDERS + 1)])
    return _with_shares(kinds)


def _waves_of(batch: ArmStates, joint: str, factor: str) -> list[MotionLaw]:
    """List what an angle may do by another joint's direction or load: few laws."""
    x = covariate(batch, joint)
    middle, half = (float(x.min()) + float(x.max())) / 2, float(np.ptp(x)) / 2
    size = float(np.abs(covariate(batch, factor)).max())
    waves = [f"harmonic {n}" for n in range(1, OTHER_ORDERS + 1)]
    return _with_shares(
        [
            [PartMotion("joint 1", joint, factor, law, middle, half, size) for law in k]
            for k in (["linear"], waves)
        ]
    )


def _with_shares(kinds: Sequence[Sequence[PartMotion | Curve]]) -> list[MotionLaw]:
    """Give each kind of law the same share of a driver, and each of a kind."""
    return [
        MotionLaw(effect, -float(np.log(len(kinds) * len(kind))))
        for kind in kinds
        for effect in kind
    ]


def _places(x: Floats, alone: bool) -> list[float]:
    """List where a step or a bend is tried: evenly, and evenly among the rows.

    Args:
        x: The driver, (n,).
        alone: Whether nothing multiplies it; else fewer are tried.
    """
    part = np.arange(1, STEPS + 1) / (STEPS + 1)
    if not alone:
        part = part[1::2]
    even = x.min() + np.ptp(x) * part
    return sorted({*map(float, even), *map(float, np.quantile(x, part))})


# Everything that is searched: what has a name, and the rest of the table.

DRAWS = 100  # of which the largest evidence of the table is taken


@dataclass(frozen=True, eq=False)
class Causes:
    """All candidates.

    Attributes:
        library: Effects with names, and free forms.
        table: All other cells; None where names alone are sought.
    """

    library: Library
    table: Table | None = None

    @classmethod
    def of(cls, fit: Fit, without: Collection[str] = ()) -> Causes:
        """List all candidates that a fit's rows can show.

        Args:
            fit: The fit.
            without: Names of effects that are known not to be there.
        """
        return cls(Library.of(fit, without), Table.of(fit, without))

    @property
    def without(self) -> frozenset[str]:
        """Names of effects that are known not to be there."""
        return self.library.without

    def narrow(
        self, view_of: Callable[[Carrier], Projection], before: Causes
    ) -> Causes:
        """Keep the best families of the table alone, see `Table.narrow`."""
        if self.table is None or before.table is None:
            return self
        return replace(self, table=self.table.narrow(view_of, before.table))

    def at_rows(self, rows: Ints) -> Causes:
        """Return the candidates for some of the rows."""
        table = None if self.table is None else self.table.at_rows(rows)
        return Causes(self.library.at_rows(rows), table)

    def null(self, projection: Projection, seed: int) -> Null:
        """Draw from the current model and score everything against each draw.

        Names and cells have a threshold each, as names are few and cells many.
        """
        rows = draws(projection, seed)
        square = np.einsum("rd,rd->d", rows, rows)
        reduced = self.library.reduce(projection, rows)
        names = np.sort(family_maxima(reduced, square, projection.rows))
        if self.table is None:
            return Null(names)
        some = rows[:, :DRAWS]
        cells = self.table.maxima(projection, some, square[:DRAWS])
        return Null(names, Null(np.sort(cells)))
