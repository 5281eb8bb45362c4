"""What may have moved since: how each cause would show in a check, and how surely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp
from scipy.stats import f, ncx2

from postproc.arrays import Floats, Ints
from postproc.model.model import Model
from postproc.record.events import Event
from postproc.record.knowledge import Expected
from postproc.robot.pose import MM

SCALES = np.geomspace(0.03, 3.0, 9)  # of a change, in sizes of its kind
BLUNDER = 1e-3  # [m] size of a reading that is none
FOUND = 0.95  # of changes that a check is to find
ALIKE = 0.98  # squared correlation of two causes that a check cannot tell apart
BLIND = 10.0  # sizes of a kind below which a check must find it, or is blind to it
ZERO, TOOL, BASE = "zero of joint", "tool", "base"


@dataclass(frozen=True, eq=False)
class Change:
    """Something that may have changed.

    Attributes:
        name: As people say it.
        event: What happened then; None for a reading that went wrong.
        own: Parameters that it changes, (r,); rows that it is of for a reading.
        size: Of each, standard deviation of the change, (r,).
        also: Names of others that change the same in this model.
    """

    name: str
    event: Event | None
    own: Ints
    size: Floats
    also: tuple[str, ...] = ()

    def columns(self, expected: Expected) -> Floats:
        """Return how the readings move by it, a size at a time, (m, r) [m]."""
        if self.event is not None:
            return np.asarray(expected.columns[:, self.own] * self.size)
        out = np.zeros((len(expected.left), 3))
        out[self.own, np.arange(len(self.own)) % 3] = BLUNDER
        return out


@lru_cache(maxsize=4)
def causes_of(model: Model) -> tuple[Change, ...]:
    """List what may change of an arm, from single zeros to whole gears, each once.

    Those of a model are listed once: a robot's life asks for them in every check.
    """
    found = dict[tuple[int, ...], Change]()
    for name, event in _events():
        variance = event.widening(model)
        own = np.flatnonzero(variance)
        if (key := tuple(own.tolist())) in found:
            found[key] = replace(found[key], also=(*found[key].also, name))
        elif key:
            found[key] = Change(name, event, own, np.sqrt(variance[own]))
    return tuple(found.values())


def _events() -> Iterator[tuple[str, Event]]:
    for j in range(1, 7):
        yield f"{ZERO} {j}", Event("remastered", (j,))
    yield TOOL, Event("tool")
    yield BASE, Event("base")
    for kind in ("motor", "gear"):
        for j in range(1, 7):
            yield f"{kind} of joint {j}", Event(kind, (j,))


def readings_of(ids: tuple[str, ...]) -> list[Change]:
    """List the readings of the arm that may have gone wrong, one a row."""
    rows = np.arange(3 * len(ids)).reshape(-1, 3)
    size = np.full(3, BLUNDER)
    return [
        Change(f"reading {name}", None, own, size)
        for name, own in zip(ids, rows, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Shown:
    """How a cause shows in a check.

    Attributes:
        cause: The cause.
        nats: Log evidence for it over no change.
        change: Of each of its parameters, (r,) [SI].
        std: Its standard error, (r,).
    """

    cause: Change
    nats: float
    change: Floats
    std: Floats

    def describe(self) -> str:
        """Say what moved by how much."""
        event, name = self.cause.event, " or ".join((self.cause.name, *self.cause.also))
        if event is None:
            size = float(np.linalg.norm(self.change)) / MM
            return f"{name} is {size:.3f} mm off: read it again"
        if name == TOOL:
            return f"{name} by {_length(self.change, self.std)}"
        if name == BASE:
            turn = float(np.linalg.norm(self.change[3:])) / MM
            shift = _length(self.change[:3], self.std[:3])
            return f"{name} by {shift}, turned by {turn:.2f} mrad"
        zero, own = float(self.change[0]) / MM, float(self.std[0]) / MM
        if name.startswith(ZERO):
            return f"{name} by {zero:+.2f} +- {own:.2f} mrad"
        return f"{name} (its zero by {zero:+.2f} +- {own:.2f} mrad)"


def _length(change: Floats, std: Floats) -> str:
    size = float(np.linalg.norm(change))
    along = float(np.linalg.norm(change * std) / max(size, 1e-12))
    return f"{size / MM:.2f} +- {along / MM:.2f} mm"


def weigh(causes: Sequence[Change], expected: Expected, scale: float) -> list[Shown]:
    """Weigh every cause by the readings of a check, the likeliest first.

    The evidence of a change of unknown size is the mean over sizes, each with a normal
    law: with columns C, precision M of the readings y and size g,

        log p(y | g) - log p(y) = u' A u / 2 - log det(I + g^2 B) / 2,
        u = C' M y, B = C' M C, A = (I / g^2 + B)^-1

    A reading that went wrong may be any of them: it needs the log of their number more.

    Args:
        causes: The causes.
        expected: The readings.
        scale: Variance of the readings over what is expected of it.
    """
    blunders = sum(c.event is None for c in causes)
    found = [_weigh(c, expected, scale, blunders) for c in causes]
    return sorted(found, key=lambda s: (-round(s.nats, 1), len(s.cause.own)))


def _weigh(cause: Change, expected: Expected, scale: float, blunders: int) -> Shown:
    u, B = project(cause, expected)
    u, B, eye = u / scale, B / scale, np.eye(len(u))
    each = []
    for g in SCALES:
        A = np.linalg.inv(eye / g**2 + B)
        each.append((0.5 * u @ A @ u - 0.5 * np.linalg.slogdet(eye + g**2 * B)[1], A))
    nats = float(logsumexp([e for e, _ in each]) - np.log(len(SCALES)))
    if cause.event is None:
        nats -= float(np.log(blunders))
    A = max(each, key=lambda pair: pair[0])[1]
    return Shown(cause, nats, cause.size * (A @ u), cause.size * np.sqrt(np.diag(A)))


def project(cause: Change, expected: Expected) -> tuple[Floats, Floats]:
    """Return u = C' M y, (r,), and B = C' M C, (r, r), of a cause's columns C."""
    C = cause.columns(expected)
    known = C.T @ expected.precision
    return known @ expected.left, known @ C


@dataclass(frozen=True, eq=False)
class Power:
    """What a check can tell, whatever it reads.

    Attributes:
        found: Least change of every cause that is found in 95 %, in sizes of its kind;
            infinite where the check is blind to it.
        alike: Pairs of causes that it hardly tells apart.
    """

    found: dict[str, float]
    alike: tuple[tuple[str, str], ...]

    @classmethod
    def of(
        cls, causes: Sequence[Change], expected: Expected, limit: float, scale: float
    ) -> Power:
        """Work it out.

        Args:
            causes: The causes.
            expected: The readings of a check, whatever they are.
            limit: Of T2 with which an alarm is raised.
            scale: Variance of the readings over what is expected of it.
        """
        needed = noncentrality(limit, expected.free) * scale
        found = {c.name: _least_found(c, expected, needed) for c in causes}
        return cls(found, _list_alike(causes, expected))

    @property
    def blind(self) -> tuple[str, ...]:
        """Causes that it cannot see."""
        return tuple(n for n, least in self.found.items() if not np.isfinite(least))


def _least_found(cause: Change, expected: Expected, needed: float) -> float:
    """Return the least change that is found, see `Power`.

    Of several parameters: a change along the direction that shows least but for those
    that do not show at all.

    Args:
        cause: The cause.
        expected: The readings.
        needed: What T2 is to grow by.
    """
    _, B = project(cause, expected)
    shows = np.linalg.eigvalsh(B)
    seen = shows[shows > needed / BLIND**2]
    return float(np.sqrt(needed / seen.min())) if len(seen) else float("inf")


def noncentrality(limit: float, free: int) -> float:
    """Return the noncentrality of chi square at which 95 % exceed a limit."""

    def short(value: float) -> float:
        return float(ncx2.sf(limit, free, value)) - FOUND

    return float(brentq(short, 1e-6, 1e4))


def limit_of(free: int, false_alarms: float, sure: float) -> float:
    """Return the limit of T2 of a share of false alarms.

    Args:
        free: Degrees of freedom of T2.
        false_alarms: The share.
        sure: Degrees of freedom from which the scatter of readings is known: T2 over
            its own is F distributed.
    """
    return float(free * f.isf(false_alarms, free, sure))


def _list_alike(
    causes: Sequence[Change], expected: Expected
) -> tuple[tuple[str, str], ...]:
    """List pairs of single causes that a check cannot tell apart."""
    single = [c for c in causes if "motor" not in c.name and "gear" not in c.name]
    return tuple(
        (one.name, other.name)
        for k, one in enumerate(single)
        for other in single[k + 1 :]
        if _are_alike(one, other, expected)
    )


def _are_alike(one: Change, other: Change, expected: Expected) -> bool:
    """Return True if a check can hardly tell two causes apart.

    All that the smaller one of them does, the other does as well.
    """
    C, D = one.columns(expected), other.columns(expected)
    C, D = (C, D) if C.shape[1] <= D.shape[1] else (D, C)
    M = expected.precision
    shown = C.T @ M @ C
    shared = C.T @ M @ D @ np.linalg.pinv(D.T @ M @ D, rcond=1e-9) @ D.T @ M @ C
    trace = float(np.trace(shown))
    return trace > 0 and float(np.trace(shared)) > ALIKE * trace
