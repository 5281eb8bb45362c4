"""What an effect is: a named cause of error, linear in named parameters.

The error of an arm is a sum of effects, error(state) = sum_k X_k(state) p_k, measured
as actual minus nominal TCP position for the commanded joints, in the base frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import Floats
from postproc.model.covariate import covariate, varies_enough
from postproc.model.effects.policies import FitPolicy, NamingPolicy, SearchPolicy
from postproc.model.kinematics import ArmStates
from postproc.model.splines import Splines
from postproc.model.terms import Driver, Term, Terms, linear, turn_joint
from postproc.robot.arm import Arm
from postproc.robot.state import States

Origin = Literal["arm", "state", "setup"]

Cells = tuple[tuple[str, str, str], ...]  # carrier, driver and law of each
EVENTS = (
    "remastered", "motor", "gear", "arm", "tool", "base", "crash", "payload",
    "software",
)  # fmt: skip
GEARED = frozenset({"gear", "arm"})
DRIVEN = frozenset({"motor", "gear", "arm"})
PLAY = frozenset({"gear", "crash", "arm"})
ZERO = frozenset({"remastered", "motor", "gear", "crash", "arm"})
PART_MOTION = "part_motion"  # what has no name but its place, its driver and its law
ANY = ("linear", "step", "saturating", "curve", "harmonic")

FAR = 1e3  # [rad] a joint angle that no arm reaches: no range is known
BEHIND_WEIGHT = 3.0  # nats by which what follows angles must beat the weight: 20 to 1


@dataclass(frozen=True)
class Parameter:
    """One unknown of an effect.

    Attributes:
        name: Unique within its effect, for instance ``theta4``.
        unit: SI unit.
        scale: Prior standard deviation in that unit, before the data rescale it.
        group: Parameters of a group share one data-driven factor on their scales.
        joint: Joint number 1 to 6 that it acts on, or None.
        positive: Whether physics forbids a value below 0.
    """

    name: str
    unit: str
    scale: float
    group: str
    joint: int | None = None
    positive: bool = False


@dataclass(frozen=True)
class Effect(ABC):
    """One cause of error. Subclasses are frozen dataclasses of plain settings.

    Everything that a fit, a search and a report must know of an effect stands in its
    own class; they ask for it here, of all effects alike.

    Class attributes:
        name: Name in model files and reports.
        direct: True where the effect is odd in the arrival direction.
        driven_by: Kind of covariate that drives it, one of `covariate.DRIVERS`.
        fit_policy: When a fit takes it where no effects are asked for.
        search_policy: Whether a fit searches for it in its residual.
        naming_policy: What a report says where `diagnose` adds it.
        variation_of: Name of the plainer effect that a search takes first.
        cells: The cells of the table of causes that it is: carrier, driver and law.
        acts: What it moves and what drives that, in the words of the table of causes,
            where it is more than `cells`, several of them at once say.
        at_one_row: True for what happens once, at one moment of a campaign.
        sets_zero: True for what leaves the zero of its joint at another place.
        free: True for a function that may have any shape: what no law predicts.
        everywhere: True for what is the same at all poses, unseen ones too.
        published: True for what a method of the literature trains: no fit of effects
            knows it.
        renewed_by: Events in the life of a robot after which it may be another one, of
            `EVENTS`; nothing for what belongs to a survey's set-up.
    """

    name: ClassVar[str]
    direct: ClassVar[bool] = False
    driven_by: ClassVar[str] = "joint"
    fit_policy: ClassVar[FitPolicy] = FitPolicy.ON_REQUEST
    search_policy: ClassVar[SearchPolicy] = SearchPolicy.NEVER
    naming_policy: ClassVar[NamingPolicy] = NamingPolicy.NAMED
    variation_of: ClassVar[str | None] = None
    acts: ClassVar[tuple[tuple[str, str], ...]] = ()
    at_one_row: ClassVar[bool] = False
    sets_zero: ClassVar[bool] = False
    free: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
    published: ClassVar[bool] = False
    cells: ClassVar[Cells] = ()
    renewed_by: ClassVar[frozenset[str]] = frozenset({"arm"})

    @classmethod
    def propose(cls, arm: Arm, states: States) -> Self:
        """Make the effect with the settings that fit an arm and a survey."""
        return cls()

    def pieces(self) -> tuple[Self, ...]:
        """Return what is weighed by itself of it: the effect at each of its joints."""
        return (self,)

    def least_evidence(self) -> float:
        """Return the evidence beyond that of others that it must be worth [nats].

        What few arms have, and what many columns tell, is a false name sooner. Nearly
        all arms yield to their weight, which follows the angles as well.
        """
        follows_angles = (
            self.driven_by == "joint" and self.fit_policy == FitPolicy.IF_EVIDENT
        )
        return BEHIND_WEIGHT if follows_angles else 0.0

    @classmethod
    def may_show(cls, states: States) -> bool:
        """Tell whether a survey can show it: what drives it varies enough."""
        return varies_enough(states, cls.driven_by)

    @classmethod
    def may_be_searched(cls, states: States) -> bool:
        """Tell whether rows let a fit look for it, see `search_policy`."""
        return True

    @classmethod
    def may_show_alone(cls, states: States) -> bool:
        """Tell the same where the tracker is known to stand still."""
        return cls.may_show(states)

    @classmethod
    def candidates(cls, batch: ArmStates) -> list[Candidate]:
        """List what a search may try of it, a grid over what is not linear.

        Args:
            batch: The surveyed states, for ranges and for what was recorded.
        """
        return []

    @classmethod
    def propose_sighted(
        cls, batch: ArmStates, tracker: tuple[float, float, float] | None
    ) -> list[Candidate]:
        """List what else may be tried of it by where the tracker stands.

        Args:
            batch: The surveyed states.
            tracker: Where that is, base frame [m], or None where nobody knows.
        """
        return []

    def see_from(self, tracker: tuple[float, float, float] | None) -> Self:
        """Return it as it shows to a tracker at a place, base frame [m]."""
        return self

    @classmethod
    def not_tried(cls, batch: ArmStates) -> tuple[str, ...]:
        """Say what of its kind is no candidate for these rows, however large it is."""
        return ()

    def refine(self, offsets: Floats, batch: ArmStates) -> list[Effect]:
        """Vary what is not linear in it; nothing where there is nothing finer.

        Args:
            offsets: How far, in steps of the grid of `candidates`.
            batch: The surveyed states, for ranges.
        """
        return []

    def plainer(self) -> Effect:
        """Return what is taken instead where it explains hardly less."""
        return self

    def readable(
        self, batch: ArmStates, without: Collection[str]
    ) -> tuple[Effect, str] | None:
        """Return it as driven by what a job can read, and the covariate's name.

        It is taken where what drives it now does not explain clearly more, and would
        not be compensated. None where there is no such form.

        Args:
            batch: The surveyed states, for what was recorded.
            without: Names of effects that are known not to be there.
        """
        return None

    def beside(self, others: Sequence[Effect]) -> Effect:
        """Return it as it is fitted beside others, which may hold a part of it."""
        return self

    def beside_waves(self, states: States) -> Effect:
        """Return it as it is fitted once the waves that it may hold are named.

        Args:
            states: States of the rows.
        """
        return self

    def hold(self, factor: float) -> Effect | None:
        """Return it with friction that holds gears against more weight.

        Args:
            factor: How much more.

        Returns:
            None for what does not begin where weight is more than friction holds.
        """
        return None

    def has_mean(self) -> bool:
        """Return True if the zero of its joint, fitted without it, holds its mean."""
        return False

    def free_zeros(self, joints: Collection[int], moved: bool = False) -> Effect:
        """Return it with the zeros of joints, from 1, to be fitted again.

        Args:
            joints: The joints.
            moved: Whether something has moved these zeros, by whatever amount.
        """
        return self

    def attribute_drift(self, told: bool, batch: ArmStates) -> Effect:
        """Return it as it counts by what is known of the tracker's own drift.

        Args:
            told: Whether readings of fixed points say that it is not the tracker's.
            batch: The surveyed states.
        """
        return self

    def belongs_to(self) -> Origin:
        """Say whose error it is.

        That of the "arm" is compensated; that of a "state" is compensated for the
        state that the cell declares; that of the "setup" of a survey never is.
        """
        return "arm"

    def requires(self) -> tuple[str, ...]:
        """List the covariates of `States` without which it cannot be evaluated."""
        return ()

    def list_nonlinear_drivers(self) -> tuple[str, ...]:
        """List the covariates of `States` that drive it by a law that is no line."""
        return ()

    def list_renewals(self) -> tuple[frozenset[str], ...]:
        """Return after which events each of its p parameters may be another one."""
        none = self.belongs_to() == "setup"
        own = frozenset[str]() if none else self.renewed_by
        return tuple(own for _ in self.parameters())

    def refers_to(self) -> str:
        """Name the state that predictions are for, where it passes with time alone."""
        return ""

    def without_clock(self, known: Collection[str]) -> Effect:
        """Return it as it counts for rows whose moment is unknown: at its mean.

        Args:
            known: Clocks that the rows have, of "time" and "order".
        """
        return self

    def unknown_variance(self, at: ArmStates) -> Floats | None:
        """Variance of readings by what no row of the survey shows, (n, 3) [m^2].

        Args:
            at: n states, with the kinematics taken at the parameters.

        Returns:
            None where the parameters' covariance has it all.
        """
        return None

    def moment_variance(self, batch: ArmStates, p: Floats) -> Floats | None:
        """Give the variance that an unknown moment brings, (n, 3) [m^2], None for 0.

        Args:
            batch: The states.
            p: Its parameters.
        """
        return None

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Name the p parameters, in the order of the columns."""

    @abstractmethod
    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position: (n, 3, p) [m per unit], base frame."""

    def rotation_columns(self, batch: ArmStates) -> Floats | None:
        """Differentiate the tool's rotation: (n, 3, p) [rad per unit], None if 0."""
        return None

    def displacement(self, batch: ArmStates, p: Floats) -> Floats:
        """Move the TCP: (n, 3) [m] for parameters p."""
        moved: Floats = self.columns(batch) @ p
        return moved

    def angles(self, batch: ArmStates, p: Floats) -> Floats:
        """Return the errors of gears, joints or drives, (n, 6) [rad], 0 without."""
        return np.zeros((len(batch), 6))

    def terms(self, arm: Arm, p: Floats) -> Terms | None:
        """Write it as the core evaluates it; None for what is never compensated.

        Args:
            arm: The nominal arm.
            p: Its parameters.
        """
        return None

    def list_ended(self, prior_std: Floats) -> tuple[float, ...]:
        """List what every term may be where it has ended [rad^2], none for nothing.

        Args:
            prior_std: Of its parameters, as the data chose it, (p,).
        """
        return ()

    def direction_slopes(self, batch: ArmStates, p: Floats) -> Floats | None:
        """Give its position error per unit of each direction, (n, 3, 6) [m].

        None where that follows from the errors of joints, or there is none.
        """
        return None

    def beyond(self, batch: ArmStates, prior_std: Floats) -> Floats | None:
        """Give the variance of what it may be where it has ended, (n, 6) [rad^2].

        A free form that fades to zero outside the surveyed range knows nothing there:
        not that the error is zero. None where it does not end.

        Args:
            batch: The states.
            prior_std: Of its parameters, as the data chose it, (p,).
        """
        return None

    def only_joint(self) -> int | None:
        """Return the joint, from 0, that all its columns turn, None without one."""
        return None

    def fine(self, joint: int) -> NDArray[np.int64]:
        """Number its parameters that map a joint, from 1, finely enough for waves."""
        return np.zeros(0, dtype=np.int64)

    def turning(self, batch: ArmStates) -> Floats:
        """Evaluate by what each column turns `only_joint`, (n, p) [rad per unit]."""
        raise TypeError(f"{self.name} turns no joint alone")

    def zero_errors(self, p: Floats) -> Floats:
        """Return by what it turns every D-H angle wherever the arm stands, (6,) [rad].

        Args:
            p: Its parameters.
        """
        return np.zeros(6)

    def joint_zeros(self, p: Floats) -> Floats:
        """Return by what it turns every controller angle at all poses, (6,) [rad].

        Args:
            p: Its parameters.
        """
        return np.zeros(6)

    def list_tied(self, batch: ArmStates) -> tuple[str, ...]:
        """Name effects that explain the same at any poses: one is never named alone.

        Args:
            batch: The states.
        """
        return ()

    def settings(self) -> dict[str, Any]:
        """Return the settings as plain data, for a model file."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def nonlinear(self) -> dict[str, tuple[float, str]]:
        """List the settings that are not linear: value and unit, as people use them."""
        return {}

    def doubt(self) -> float:
        """Return what evidence its settings cost that are no usual ones [nats]."""
        return 0.0

    def sentence(self, p: Floats, covariance: Floats) -> str:
        """Say place, driver, law and size of what has no name, "" of what has one.

        Args:
            p: Its parameters, (p,).
            covariance: Of them, (p, p).
        """
        return ""

    def amplitude(self, p: Floats, covariance: Floats) -> tuple[float, float] | None:
        """Return the size of a wave and its standard error [rad], None without one.

        Args:
            p: Its parameters, (p,).
            covariance: Of them, (p, p).
        """
        return None


@dataclass(frozen=True)
class JointEffect(Effect):
    """An effect that turns joints: columns are J_j(q) phi(covariate)."""

    @abstractmethod
    def basis(self, batch: ArmStates) -> Floats:
        """Evaluate phi: the angle of each parameter's joint, (n, p) [rad per unit]."""

    def terms(self, arm: Arm, p: Floats) -> Terms | None:
        """Turn every joint by its columns; laws that the core knows are faster."""
        columns = [Driver("given", column=(self, k)) for k in range(len(p))]
        return [
            Term(turn_joint(int(j) + 1), linear(k), (column,))
            for j, k, column in zip(self.acts_on(), p, columns, strict=True)
        ]

    def splines(self, batch: ArmStates) -> list[tuple[int, Splines, Floats]] | None:
        """Write the columns as splines, in their order, where they are made of them.

        Returns:
            Joint from 0, its splines, and what of each makes every column, (m, k).
        """
        return None

    def acts_on(self) -> NDArray[np.int64]:
        """Return the 0-based joint that each parameter turns, (p,)."""
        return self._acts_on

    @cached_property
    def _acts_on(self) -> NDArray[np.int64]:
        """Find them once: a program asks some hundred times."""
        return np.array([(p.joint or 1) - 1 for p in self.parameters()], dtype=int)

    def has_mean(self) -> bool:
        """Return True but for constants, and for what the direction changes."""
        return not self.direct and not self.everywhere

    def only_joint(self) -> int | None:
        """Tell from the parameters."""
        joints = set(self.acts_on().tolist())
        return joints.pop() if len(joints) == 1 else None

    def turning(self, batch: ArmStates) -> Floats:
        """Evaluate phi, (n, p)."""
        return self.basis(batch)

    def columns(self, batch: ArmStates) -> Floats:
        """Differentiate the TCP position: (n, 3, p) [m per unit]."""
        return self._about(batch.jacobian, batch)

    def rotation_columns(self, batch: ArmStates) -> Floats:
        """Differentiate the tool's rotation: (n, 3, p) [rad per unit]."""
        return self._about(batch.angular, batch)

    def _about(self, joints: Floats, batch: ArmStates) -> Floats:
        """Turn the joints, (n, 3, 6) per unit, by each parameter, (n, 3, p)."""
        columns: Floats = joints.T[self.acts_on()] * self.basis(batch).T[:, None]
        return columns.T

    def angles(self, batch: ArmStates, p: Floats) -> Floats:
        """Return the joint errors (n, 6) [rad] for parameters p."""
        out = np.zeros((len(batch), 6))
        turned = self.basis(batch) * p
        for joints, columns in self._layers:
            out[:, joints] += turned[:, columns]
        return out

    @cached_property
    def _layers(self) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """Name the first parameter of every joint, then the second ones, .."""
        acts_on = self.acts_on()
        nth = np.array(
            [np.count_nonzero(acts_on[:k] == j) for k, j in enumerate(acts_on)]
        )
        columns = [np.flatnonzero(nth == k) for k in range(nth.max(initial=-1) + 1)]
        return [(acts_on[c], c) for c in columns]


def own_cells(driver: str, *laws: str) -> Cells:
    """Name cells of every joint, each driven by what is its own.

    >>> own_cells("torque {j}", "linear")[1]
    ('joint 2', 'torque 2', 'linear')

    Args:
        driver: The driver, ``{j}`` for the number of the joint.
        laws: The laws.
    """
    return tuple(
        (f"joint {j}", driver.format(j=j), law) for j in range(1, 7) for law in laws
    )


def cells_in_time(part: str, *laws: str) -> Cells:
    """Name all motions of the base or the tool in the course of a campaign.

    Args:
        part: "base" or "tool".
        laws: The laws.
    """
    return tuple(
        (f"{part} {motion} {a}", clock, law)
        for motion in ("shift", "turn")
        for a in "xyz"
        for clock in ("order", "time")
        for law in laws
    )


# What a search may try of an effect.

NAMED, FREE = 0, 1


@dataclass(frozen=True)
class Family:
    """What a person calls one cause: candidates of a family differ in settings only.

    Attributes:
        effect: Name of the effect.
        joint: Joint 1 to 6 that it acts on, or None.
        driver: What drives it where that is part of the name (``joint 5`` of a
            coupling, the covariates of a curve), or None.
        tier: NAMED for physics, FREE for functions that may have any shape.
        along: Axis ``base x`` .. ``tool z`` that it moves the TCP along, or None.
    """

    effect: str
    joint: int | None
    driver: str | None
    tier: int
    along: str | None = None

    def __str__(self) -> str:
        if self.effect == PART_MOTION:
            by = "" if self.driver is None else f" by {self.driver}"
            return f"{self.along or f'joint {self.joint}'}{by}"
        where = "" if self.joint is None else f" of joint {self.joint}"
        by = "" if self.driver is None else f" by {self.driver}"
        along = "" if self.along is None else f" along {self.along}"
        return f"{self.effect}{where}{by}{along}"


@dataclass(frozen=True)
class Candidate:
    """One effect to try, with all its settings.

    Attributes:
        family: Its family.
        effect: The effect with its settings.
        source: Covariate that reveals it, for the report.
        log_prior: Log of its share of the family: a grid shares what the family has.
    """

    family: Family
    effect: Effect
    source: str
    log_prior: float

    @cached_property
    def width(self) -> int:
        """Number of columns."""
        return len(self.effect.parameters())

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of its parameters in a model."""
        effect = self.effect
        return frozenset(f"{effect.name}.{p.name}" for p in effect.parameters())

    @property
    def in_time(self) -> bool:
        """Whether what drives it passes with time rather than from pose to pose."""
        return self.source in ("order", "time", "temperature")

    def driver(self, batch: ArmStates) -> Floats:
        """Return the covariate along which the candidate varies, (n,)."""
        name = "order" if self.in_time else self.source.split(" x ")[0]
        return np.nan_to_num(covariate(batch, name))


def alternatives(
    members: Sequence[tuple[Effect, str]],
    joint: int | None = None,
    driver: str | None = None,
    tier: int = NAMED,
) -> list[Candidate]:
    """Make the candidates of one family, each with an equal share of its prior.

    Args:
        members: Effects of one name, each with the covariate that reveals it.
        joint: Joint 1 to 6 that all of them act on, or None.
        driver: What drives them where that is part of the name.
        tier: NAMED or FREE.
    """
    share = -float(np.log(max(len(members), 1)))
    return [
        Candidate(Family(effect.name, joint, driver, tier), effect, source, share)
        for effect, source in members
    ]


# Free-form parts end where the survey did.


def fade(x: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return 1 inside [lower, upper], falling smoothly to 0 a tenth outside.

    Free-form parts are multiplied by it: outside the training range they know nothing.

    >>> fade(np.array([0.5, 1.05, 2.0]), np.array(0.0), np.array(1.0)).tolist()
    [1.0, 0.5, 0.0]
    """
    width = np.maximum(0.1 * (upper - lower), 1e-9)
    out = np.maximum(np.maximum(lower - x, x - upper), 0.0) / width
    t = np.clip(out, 0.0, 1.0)
    faded: Floats = np.round(1.0 - t * t * (3.0 - 2.0 * t), 12)
    return faded


def fade_turns(q: Floats, lower: Floats, upper: Floats) -> Floats:
    """Fade what repeats with every turn: an angle counts as its nearest turn's.

    >>> fade_turns(np.array([0.1 + 2 * np.pi]), np.array(0.0), np.array(1.0)).tolist()
    [1.0]
    """
    out = np.ones(np.broadcast_shapes(q.shape, lower.shape))
    odd = ~((q >= lower) & (q <= upper))  # most are inside as they are
    if odd.any():
        x, low, high = (np.broadcast_to(a, odd.shape)[odd] for a in (q, lower, upper))
        middle = (low + high) / 2
        near = middle + np.mod(x - middle + np.pi, 2 * np.pi) - np.pi
        whole = high - low > 0.95 * 2 * np.pi
        out[odd] = np.where(whole, 1.0, fade(near, low, high))
    return out
