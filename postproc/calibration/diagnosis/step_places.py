"""Where a step is: in the middle of all places that the rows leave open.

Of a step a row tells on which side it is. Every place between two rows explains them as
well, and where a load drives the step the links may weigh this or that besides, each
with a place of its own. The best one is any corner of what is open; the mean of what is
open misses the fewest poses between the rows. It is found by walking: along a line
through place and moments the rows change sides one after the other, so that the
posterior along it is a normal density, weighted otherwise from row to row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from postproc.arrays import Floats
from postproc.calibration.diagnosis.link_weights import links_beyond, moment_root
from postproc.calibration.diagnosis.search import NEAR, Search, with_effects
from postproc.calibration.regression import Fit
from postproc.model.covariate import by_weight, covariate
from postproc.model.effects.part_motion import PartMotion
from postproc.model.kinematics import ArmStates

WALK = 1000  # points of each of two walks: the first finds the ways of the second
SETTLED = 300  # of the first one, before it has forgotten where it began
ROWS = 40  # beside a step, which say how far it may go at first
FREE = 1e-6  # of a moment's prior that a place has: it may be any
FARTHEST = 38.0  # standard deviations beyond which a normal density is none
NARROWEST = 1e-9  # part of a range, or of all ways, that is one still
CONSTANT = 1e-6  # part of a load's slopes that no row shows


def place_steps(found: Search) -> Search:
    """Move the steps of a search to the middle of where they may be.

    Args:
        found: The search. A step whose middle explains the rows less well stays.
    """
    for number, addition in enumerate(found.additions):
        place = found.place(number)
        effects = list(found.fit.combination.effects)
        step = effects[place]
        if not isinstance(step, PartMotion) or step.law != "step":
            continue
        moved = effects[place] = find_middle(found.fit, place)
        fit = with_effects(found.fit, effects)
        if fit.log_evidence < found.fit.log_evidence - NEAR:
            continue
        additions = list(found.additions)
        best = replace(addition.candidate, effect=moved)
        score = replace(addition.score, best=best)
        additions[number] = replace(addition, score=score)
        found = replace(found, fit=fit, additions=tuple(additions))
    return found


def find_middle(fit: Fit, place: int) -> PartMotion:
    """Return a step of a fit in the middle of where the rows let it be.

    Args:
        fit: The fit.
        place: Place of the step among its effects.
    """
    step = fit.combination.effects[place]
    assert isinstance(step, PartMotion)
    at = fit.combination.at(fit.batch, fit.values)
    x = covariate(at, step.source)
    half, level = float(np.ptp(x)) / 2, float(x.mean())
    links, root, slopes = _slopes(step, at)
    mean = slopes.mean(axis=0)
    known = dict(step.heavier)
    heavier = np.array([known.get(k, (0.0, 0.0, 0.0)) for k in links]).reshape(-1)
    own = np.linalg.solve(root, heavier)
    sides = Sides(
        (x - level) / half,
        np.column_stack([-np.ones(len(x)), (slopes - mean) / half]),
        _measure_pull(fit, place, step),
    )
    middle = sides.find_mean(np.r_[(step.middle - level - mean @ own) / half, own])
    middle[1:] = _project_on_rows(slopes - mean, middle[1:])
    more = (root @ middle[1:]).reshape(-1, 3)
    return replace(
        step,
        middle=level + half * float(middle[0]) + float(mean @ middle[1:]),
        heavier=tuple(
            (k, tuple(map(float, m))) for k, m in zip(links, more, strict=True)
        ),
    )


def _slopes(step: PartMotion, at: ArmStates) -> tuple[tuple[int, ...], Floats, Floats]:
    """Differentiate the load of a step by what is unsure of the weights of links.

    Returns:
        The links (l); the root of their moments, (3 l, 3 l), see `moment_root`; and
        the load per unit of each of its columns, (n, 3 l). None of what is no load.
    """
    per_moment = by_weight(at, step.source)
    if per_moment is None:
        return (), np.zeros((0, 0)), np.zeros((len(at), 0))
    links = links_beyond(step.source)
    root = moment_root(at.arm, links)
    own = per_moment[:, links[0] - 1 :].reshape(len(at), -1)
    return links, root, own @ root


def _project_on_rows(slopes: Floats, own: Floats) -> Floats:
    """Take out of what is unsure (m,) what changes no row, slopes (n, m)."""
    _, size, ways = np.linalg.svd(slopes, full_matrices=False)
    ways = ways[size > CONSTANT * size.max(initial=0.0)]
    part: Floats = ways.T @ (ways @ own)
    return part


def _measure_pull(fit: Fit, place: int, step: PartMotion) -> Floats:
    """Measure how much rows speak for being above a step, (n,) [nats], half of it."""
    first = fit.combination.slices[place].start
    own = fit.move(slice(first, first + 1))
    there = fit.whiten(own).reshape(-1, 3)
    seen = fit.whiten(fit.residual + own).reshape(-1, 3)
    x = step.look_up_driver(fit.batch, step.source)
    side = np.where(x < step.middle, -1.0, 1.0)
    pull: Floats = side * np.einsum("nk,nk->n", there, seen)
    return pull


@dataclass(frozen=True, eq=False)
class Sides:
    """What rows tell of the side of a step that they are on.

    Attributes:
        beyond: How far each is above a step at 0 with nominal links, (n,).
        slopes: The same per place and moments, (n, 1 + m).
        pull: Half the log odds of being above, (n,).
    """

    beyond: Floats
    slopes: Floats
    pull: Floats

    @property
    def prior(self) -> Floats:
        """Precision beforehand of place and moments, (1 + m,)."""
        prior = np.ones(self.slopes.shape[1])
        prior[0] = FREE
        return prior

    def find_mean(self, start: Floats) -> Floats:
        """Average place and moments over their posterior, (1 + m,)."""
        rng = np.random.default_rng(0)
        away = np.abs(self.beyond + self.slopes @ start)
        near = np.argsort(away, kind="stable")[:ROWS]
        width = max(float(away[near[-1]]), NARROWEST)
        slopes = self.slopes[near] / width
        precision = slopes.T @ slopes + np.diag(self.prior)
        ways = np.asarray(np.linalg.inv(precision), dtype=float)
        first = self.walk(start, ways, rng)
        ways = np.asarray(np.atleast_2d(np.cov(first[SETTLED:].T)), dtype=float)
        ways += NARROWEST * np.trace(ways) * np.eye(len(ways))
        mean: Floats = self.walk(first[-1], ways, rng).mean(axis=0)
        return mean

    def walk(self, at: Floats, ways: Floats, rng: np.random.Generator) -> Floats:
        """Walk through the posterior, (WALK, 1 + m).

        Args:
            at: Where to begin, (1 + m,).
            ways: Covariance of the lines to go along.
            rng: Of lines and steps.
        """
        root = np.linalg.cholesky(ways)
        points = np.empty((WALK, len(at)))
        beyond = self.beyond + self.slopes @ at
        for k in range(WALK):
            way = root @ rng.standard_normal(len(at))
            at = at + self.draw_step(at, way, beyond, rng) * way
            beyond = self.beyond + self.slopes @ at
            points[k] = at
        return points

    def draw_step(
        self, at: Floats, way: Floats, beyond: Floats, rng: np.random.Generator
    ) -> float:
        """Draw how far to go along a line.

        Args:
            at: Point of the line, (1 + m,).
            way: Its direction, (1 + m,).
            beyond: How far rows are above the step at the point, (n,).
            rng: Of the draw.
        """
        along = self.slopes @ way
        moving = np.flatnonzero(along)
        turns = -beyond[moving] / along[moving]
        order = np.argsort(turns, kind="stable")
        gain = (2.0 * self.pull[moving] * np.sign(along[moving]))[order]
        precision = float(way @ (self.prior * way))
        std = float(np.sqrt(1.0 / precision))
        centre = -float(way @ (self.prior * at)) / precision
        ends = np.clip((turns[order] - centre) / std, -FARTHEST, FARTHEST)
        low, high = np.r_[-FARTHEST, ends], np.r_[ends, FARTHEST]
        upper = low > 0.0  # where the density is known by what is above it
        low, high = np.where(upper, -high, low), np.where(upper, -low, high)
        mass = np.asarray(ndtr(high)) - np.asarray(ndtr(low))
        weight = np.r_[0.0, np.cumsum(gain)] + np.log(np.maximum(mass, 1e-300))
        share = np.cumsum(np.exp(weight - weight.max()))
        k = int(np.searchsorted(share, rng.random() * share[-1]))
        part = float(ndtri(float(ndtr(low[k])) + rng.random() * float(mass[k])))
        part = min(max(part, float(low[k])), float(high[k]))
        return centre + std * (-part if upper[k] else part)
