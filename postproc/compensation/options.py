"""What programs are compensated with: options, and the seconds of every stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from enum import Enum
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any

from postproc.exceptions import PostprocError

if TYPE_CHECKING:  # the command line needs options only, and must start at once
    from postproc.arrays import Floats
    from postproc.model.model import Model
    from postproc.robot.cell import Cell, SharedPoints

# What the user asked for.


class AsInCell(Enum):
    """The value of an option that is not given: the cell's."""

    AS_IN_CELL = "as in the cell"


AS_IN_CELL: Any = AsInCell.AS_IN_CELL


@dataclass(frozen=True)
class Options:
    """What the user asked for; what is not given is as [compensation] of the cell says.

    Attributes:
        temperature: Arm temperature [deg C]; default: the cell's.
        timing: Plan the program in time, before and after; None: if it is no longer
            than `IN_TIME`. Where neither this nor the cell says so, it is not.

    All others are described at `CompensationSection`.
    """

    shared_points: SharedPoints = AS_IN_CELL
    edit_exported: bool = AS_IN_CELL
    temperature: float | None = None
    orientation: bool = AS_IN_CELL
    assume_motion: bool = AS_IN_CELL
    timing: bool | None = AS_IN_CELL
    path_tolerance_mm: float | None = AS_IN_CELL
    max_inserted: int = AS_IN_CELL
    preload_backlash: bool = AS_IN_CELL
    reapproach: bool = AS_IN_CELL

    def within(self, cell: Cell) -> Options:
        """Return them with what the cell says of all that is not given.

        Raises:
            PostprocError: They do not go together.
        """
        given, own = vars(self), vars(cell.compensation)
        unset = [name for name, value in given.items() if value is AS_IN_CELL]
        found = replace(self, **{name: own[name] for name in unset})
        if "timing" in unset and found.timing is None:
            found = replace(found, timing=False)
        found._check()
        return found

    def _check(self) -> None:
        """Refuse options that do not go together."""
        tolerance = self.path_tolerance_mm
        if tolerance is not None and not tolerance > 0:
            raise PostprocError("path_tolerance_mm: give a distance of more than 0 mm")
        if tolerance is None and self.preload_backlash:
            raise PostprocError(
                "preload_backlash: no path tolerance is given. Give --path-tolerance"
            )

    @property
    def inserts(self) -> bool:
        """Tell whether points may be put into a program."""
        return self.path_tolerance_mm is not None or self.reapproach

    def without_clones(self) -> Options:
        """Return them for a program whose moves have points of their own already."""
        shared = "mean" if self.shared_points == "clone" else self.shared_points
        return replace(self, shared_points=shared)

    def to_dict(self) -> dict[str, object]:
        """Return them for a record: what is rarely asked for only if it is."""
        said = asdict(self)
        del said["timing"]  # it changes no output
        if not self.assume_motion:
            del said["assume_motion"]
        if self.path_tolerance_mm is None:
            for name in ("path_tolerance_mm", "max_inserted", "preload_backlash"):
                del said[name]
        if not self.reapproach:
            del said["reapproach"]
        return said

    def times(self, visits: int) -> bool:
        """Tell whether a program of so many visits is run in time."""
        if self.inserts:
            return True
        return visits <= IN_TIME if self.timing is None else self.timing


IN_TIME = 5_000  # visits
DEFAULT_OPTIONS = Options()

# Seconds spent in every stage.

Progress = Callable[[str], None]


def no_progress(stage: str) -> None:
    """Tell nobody."""


class Clock:
    """Seconds spent in every stage; tells the stages to whom it may concern."""

    def __init__(self, progress: Progress) -> None:
        """Start with no stage."""
        self.stages: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of a block to a stage."""
        self._progress(stage)
        start = perf_counter()
        yield
        self.add({stage: perf_counter() - start})

    def add(self, seconds: Mapping[str, float]) -> None:
        """Add stages that ran elsewhere, such as in another process."""
        for stage, spent in seconds.items():
            self.stages[stage] = self.stages.get(stage, 0.0) + spent


@dataclass(frozen=True)
class Job:
    """What a program is compensated with.

    Attributes:
        cell: The robot's surroundings, with the play that was measured.
        model: The arm's error.
        options: What the user asked for.
        clock: Times the stages.
        processes: How many may work at once; the result is the same.
        averages: Give arrivals that do not agree one correction, if the options say so;
            not while it is asked which of them need points of their own.
    """

    cell: Cell
    model: Model
    options: Options
    clock: Clock
    processes: int = 1
    averages: bool = True

    def __post_init__(self) -> None:
        """Take what is not given from the cell."""
        object.__setattr__(self, "options", self.options.within(self.cell))

    def with_clock(self, clock: Clock) -> Job:
        """Return the same with another clock."""
        return replace(self, clock=clock)

    @cached_property
    def offset(self) -> Floats:
        """By what every joint is moved for its constant zero error, (6,) [rad]."""
        return -self.model.joint_offset(self.cell.arm)

    @cached_property
    def gap(self) -> Floats:
        """Half the fitted gap between the flanks of every joint, (6,) [rad]."""
        from postproc.model.backlash_width import half_gap

        return half_gap(self.model, self.cell.arm)

    @property
    def temperature(self) -> float:
        """The arm's temperature [deg C], NaN where nobody knows."""
        given = self.options.temperature
        return self.cell.temperature if given is None else given
