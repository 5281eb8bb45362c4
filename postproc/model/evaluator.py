"""A model in the core's terms: what it predicts of many states, at once and in threads.

Effects say what they are by `columns`, for fits, and by `terms`, for programs; a test
holds one to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from postproc import _native
from postproc.arrays import Bools, Floats, Indices, Ints, few_rows, floats
from postproc.model.covariate import covariate
from postproc.model.effect_sum import Combination
from postproc.model.effects.effect import Effect, JointEffect
from postproc.model.kinematics import ArmStates, base_of, deviate
from postproc.model.noise import Noise
from postproc.model.terms import Driver, Neighbours, Neurons, Term, Terms
from postproc.robot.arm import Arm
from postproc.robot.state import States

NOWHERE = (-1, 0, 0)  # a unit that is no neuron
NO_GEOMETRY: tuple[bool, list[tuple[int, int]], bool] = (False, [], False)
Given = tuple[str, tuple[Any, int] | None, float]
"""A covariate, or a column of an effect's own; its value where it is not known."""


@dataclass(frozen=True)
class CoreStates:
    """States as the core takes them; one row of tools or loads is that of all.

    Attributes:
        q, side: Joint angles [rad] and directions, (n, 6).
        tool: TCP in the flange frame, (n, 3) or (1, 3) [m].
        load: Mass [kg] and its centre in the flange frame [m], likewise (.., 4).
        given: Covariates that do not follow from these, (n, k).
    """

    q: Floats
    side: Floats
    tool: Floats
    load: Floats
    given: Floats


class PredictedErrors(NamedTuple):
    """Predicted errors of n states, NaN where nobody has asked.

    Attributes:
        error: Actual minus nominal TCP position, base frame, (n, 3) [m].
        known: Covariance of that error, (n, 6) [m^2]: xx, yy, zz, then xy, xz, yz.
        arrival: .. of the error of one arrival, with repeatability, likewise.
    """

    error: Floats
    known: Floats
    arrival: Floats

    @classmethod
    def unknown(cls, n: int) -> PredictedErrors:
        """Make room for n predictions."""
        return cls(*(np.full((n, width), np.nan) for width in (3, 6, 6)))

    def put(self, rows: Indices | Bools, found: PredictedErrors) -> None:
        """Enter some predictions, in place."""
        self.error[rows], self.known[rows] = found.error, found.known
        self.arrival[rows] = found.arrival

    def copy(self) -> PredictedErrors:
        """Return predictions that can change on their own."""
        return PredictedErrors(*map(np.array, self))

    @property
    def std(self) -> Floats:
        """Standard error of the predicted error per axis, (n, 3) [m]."""
        return np.asarray(np.sqrt(np.maximum(self.known[:, :3], 0.0)))


@dataclass(frozen=True)
class Evaluator:
    """Effects of known parameters, as the core evaluates them.

    Attributes:
        arm: The nominal arm.
        given: The covariates that states must tell.
        core: The rest.
    """

    arm: Arm
    given: tuple[Given, ...]
    core: _native.Core

    def states(self, states: States) -> CoreStates:
        """Lay states out."""
        return CoreStates(
            floats(states.q), floats(states.direction), floats(few_rows(states.tool)),
            _loads(states), self._look_up(states),
        )  # fmt: skip

    def _look_up(self, states: States) -> Floats:
        """Return what must be given of states, (n, k)."""
        out = np.empty((len(states), len(self.given)))
        if not self.given:
            return out
        batch = ArmStates(self.arm, states)
        for k, (name, own, unknown) in enumerate(self.given):
            values = covariate(batch, name) if own is None else _column(batch, *own)
            out[:, k] = np.where(np.isnan(values), unknown, values)
        return out

    def errors(self, states: States) -> Floats:
        """Predict errors, (n, 3) [m]."""
        return self.core.errors(self.states(states))

    def turns(self, states: States) -> Floats:
        """Predict the tool's rotations from nominal to actual, (n, 3) [rad]."""
        return self.core.turns(self.states(states))

    def commands(
        self, wanted: Floats, tool: Floats, states: States, turns: bool
    ) -> tuple[Floats, Floats, Floats]:
        """Find the commands whose predicted landing is the wanted place.

        Args:
            wanted: TCP poses in the arm's base frame, (n, 4, 4) [m].
            tool: Tools in the flange frame, (n, 4, 4) [m].
            states: The nominal states at the targets, with these tools.
            turns: Correct the orientation as well as the position.

        Returns:
            Joint angles (n, 6) [rad], NaN where the command cannot be reached, TCP
            poses to command (n, 4, 4) [m], and distances of the predicted landings from
            the wanted places, (n,) [m].
        """
        laid = self.states(states)
        poses = floats(wanted), floats(few_rows(tool))
        return _native.commands(self.core, self.arm.solver, *poses, laid, turns)

    def predict(self, states: States) -> PredictedErrors:
        """Predict errors, and how sure they are."""
        return PredictedErrors(*self.core.predict(self.states(states)))


def _column(batch: ArmStates, effect: JointEffect, column: int) -> Floats:
    """Return a column of an effect's basis, (n,)."""
    basis = batch.once(effect, lambda _: effect.basis(batch))
    return np.asarray(basis[:, column])


def _loads(states: States) -> Floats:
    """Return mass and centre of what is carried, (n, 4) or (1, 4)."""
    if len(states) == 0:
        return np.empty((0, 4))
    mass, centre = few_rows(states.payload), few_rows(states.payload_com)
    centre = np.where(np.isnan(centre), few_rows(states.tool), centre)
    out = np.empty((max(len(mass), len(centre)), 4))
    out[:, 0], out[:, 1:] = np.nan_to_num(mass), centre
    return out


@dataclass(frozen=True)
class Spread:
    """How sure parameters are.

    Attributes:
        effects: Effects of p parameters: those of the model, perhaps others too.
        covariance: Of their parameters, (p, p).
    """

    effects: Combination
    covariance: Floats


@dataclass(frozen=True)
class Scatter:
    """What adds to the covariance of errors.

    Attributes:
        noise: Of joints and stops.
        spread: Standard error per axis of methods without a covariance [m].
    """

    noise: Noise
    spread: Sequence[float]

    def pack(self) -> tuple[Any, ...]:
        """Return it as the core takes it."""
        n = self.noise
        pose = n.pose_joint * np.array(n.by_joint)
        return (
            (pose.tolist(), n.pose),
            (n.joint_std.tolist(), n.stop),
            tuple(self.spread),
        )


def make_evaluator(
    arm: Arm,
    effects: Combination,
    values: Floats,
    prior_std: Floats,
    spread: Spread | None,
    scatter: Scatter,
) -> Evaluator:
    """Write effects in the core's terms.

    Args:
        arm: The nominal arm.
        effects: The effects.
        values: Their parameters, (p,).
        prior_std: As the data chose it, (p,); empty where it did not.
        spread: How sure they are, None where that is not known.
        scatter: What adds to that.

    Raises:
        TypeError: An effect has no terms.
    """
    writer = _TermWriter(arm)
    terms, fields = writer.write_all(effects, values, prior_std)
    sure = None if spread is None else writer.write_spread(spread)
    deviation = effects.deviation(values)
    real = deviate(arm.dh, deviation).pack(deviation.link[:, 4])
    core = _native.Core(
        (arm.dh.pack(), real), base_of(deviation), tuple(deviation.tool.tolist()),
        len(writer.given), terms, fields, sure, scatter.pack(),
    )  # fmt: skip
    return Evaluator(arm, tuple(writer.given), core)


class _TermWriter:
    """Writes terms as the core takes them, and collects the covariates they need."""

    def __init__(self, arm: Arm) -> None:
        """Begin without any."""
        self._arm = arm
        self.given: list[Given] = []

    def write_all(
        self, effects: Combination, values: Floats, prior_std: Floats
    ) -> tuple[tuple[list[Any], list[float]], tuple[list[Any], list[Any]]]:
        """Write the terms of effects with their variances, neurons, and maps."""
        terms, ended = list[Any](), list[float]()
        nets, maps = list[Any](), list[Any]()
        for effect, part in zip(effects.effects, effects.slices, strict=True):
            own = _terms_of(effect, self._arm, values[part])
            plain = [self._term(t) for t in own if isinstance(t, Term)]
            terms += plain
            nets += [_net(t) for t in own if isinstance(t, Neurons)]
            maps += [_map(t) for t in own if isinstance(t, Neighbours)]
            variance = effect.list_ended(prior_std[part]) if len(prior_std) else ()
            ended += variance or (0.0,) * len(plain)
        return (terms, ended), (nets, maps)

    def write_spread(self, spread: Spread) -> tuple[Any, ...]:
        """Write units of all parameters: of geometry, of no joint alone, of joints."""
        effects, nets = spread.effects, list[Any]()
        columns, first = np.arange(len(spread.covariance)), list[Ints]()
        free, turning = list[tuple[int, Any]](), list[tuple[int, int, Any]]()
        for effect, part in zip(effects.effects, effects.slices, strict=True):
            if effect in effects.placing:
                first.append(columns[part])
                continue
            units, own = self._units(effect, nets), columns[part].tolist()
            if isinstance(effect, JointEffect):
                turning += zip(effect.acts_on().tolist(), own, units, strict=True)
            else:
                free += zip(own, units, strict=True)
        turning.sort(key=lambda unit: unit[0])
        own = [*(k for k, _ in free), *(k for _, k, _ in turning)]
        order = np.concatenate([*first, np.array(own, dtype=int)])
        count = np.bincount([j for j, *_ in turning], minlength=6).tolist()
        joints = [unit for *_, unit in turning], count
        links = [(one.base, one.links, True) for one in effects.placing]
        covariance = spread.covariance[np.ix_(order, order)].ravel()
        placed = (links or [NO_GEOMETRY])[0]
        return placed, [unit for _, unit in free], joints, nets, covariance

    def _units(self, effect: Effect, nets: list[Any]) -> list[Any]:
        """Write what each parameter of an effect is multiplied with."""
        p = len(effect.parameters())
        none = _terms_of(effect, self._arm, np.zeros(p))
        if len(none) == 1 and isinstance(none[0], Neurons):
            layer, k = none[0], len(none[0].bias)
            nets.append(_net(layer))
            axis = [0 if layer.turns else i // k for i in range(p)]
            return [([], (len(nets) - 1, i % k, axis[i])) for i in range(p)]
        out = []
        for unit in np.eye(p):
            own = _terms_of(effect, self._arm, unit)
            pairs = zip(own, none, strict=True)
            told = [self._term(t) for t, zero in pairs if t != zero]
            out.append((told, NOWHERE))
        return out

    def _term(self, term: Term | Neurons | Neighbours) -> tuple[Any, ...]:
        if not isinstance(term, Term):
            raise TypeError("the covariance of a map is not known")
        by, times = ([self._driver(d) for d in some] for some in (term.by, term.times))
        return term.moves, tuple(term.law), by, times

    def _driver(self, driver: Driver) -> tuple[str, tuple[float, ...]]:
        if driver.name != "given":
            return driver.name, driver.numbers
        asked = driver.covariate, driver.column, driver.unknown
        known = [_key(one) for one in self.given]
        if _key(asked) not in known:
            self.given.append(asked)
            known.append(_key(asked))
        return "given", (float(known.index(_key(asked))),)


def _terms_of(effect: Effect, arm: Arm, p: Floats) -> Terms:
    """Return the terms of an effect.

    Raises:
        TypeError: It has none.
    """
    found = effect.terms(arm, p)
    if found is None:
        raise TypeError(f"the effect {effect.name} has no terms for the core")
    return found


def _key(given: Given) -> tuple[Any, ...]:
    """Return what a covariate is told apart by; NaN equals itself here."""
    return *given[:2], repr(given[2])


def _net(layer: Neurons) -> tuple[Any, ...]:
    """Write neurons as the core takes them."""
    ends = tuple(layer.lower.tolist()), tuple(layer.upper.tolist())
    weights, sizes = layer.weights.ravel().tolist(), layer.sizes.ravel().tolist()
    shape = layer.shape, list(layer.units)
    return *ends, weights, layer.bias.tolist(), shape, layer.turns, sizes


def _map(near: Neighbours) -> tuple[Any, ...]:
    """Write measured errors as the core takes them."""
    both = (list(map(tuple, rows.tolist())) for rows in (near.places, near.errors))
    return *both, near.count, float(near.power)
