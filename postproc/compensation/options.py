"""What programs are compensated with: options, and the seconds of every stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING

from postproc.exceptions import PostprocError

if TYPE_CHECKING:  # the command line needs options only, and must start at once
    from postproc.arrays import Floats
    from postproc.model.model import Model
    from postproc.robot.cell import Cell

# What the user asked for.

MAX_INSERTED = 1_000  # points on the ways of a program


@dataclass(frozen=True)
class Options:
    """What the user asked for.

    Attributes:
        clone: Give moves whose arrivals at one variable disagree one each.
        shared: Edit variables that other programs may read too.
        orientation: Correct the orientation of targets as well as their position.
        temperature: Arm temperature [deg C]; default: the cell's.
        strict_calls: Take no routine as motionless because the shipped list says so.
        explained: Keep what explains every target, of long programs too.
        timing: Run the program in time, before and after; None: if it is no longer than
            `IN_TIME`.
        path_mm: Put points on the ways of moves that leave their paths farther [mm],
            which runs the program in time; None: on none.
        max_inserted: The most points.
        take_up: Let the arm stop once more where a move begins, to take up play.
        approach: Approach targets anew that a joint reaches from a side that is not
            sure, which runs the program in time as well.
    """

    clone: bool = False
    shared: bool = False
    temperature: float | None = None
    orientation: bool = False
    strict_calls: bool = False
    explained: bool = False
    timing: bool | None = False
    path_mm: float | None = None
    max_inserted: int = MAX_INSERTED
    take_up: bool = False
    approach: bool = False

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises:
            PostprocError: They do not.
        """
        if self.path_mm is None and self.take_up:
            raise PostprocError("--take-up: give the tolerance of paths, --path-mm")
        if self.path_mm is not None and not self.path_mm > 0:
            raise PostprocError("--path-mm: give a distance of more than 0 mm")
        if self.path_mm is not None and self.timing is False:
            raise PostprocError("--path-mm runs the program in time: no --no-timing")
        if self.approach and self.timing is False:
            raise PostprocError("--approach runs the program in time: no --no-timing")

    @property
    def inserts(self) -> bool:
        """Tell whether points may be put into a program."""
        return self.path_mm is not None or self.approach

    def told(self) -> dict[str, object]:
        """Return them for a record: a strict reading of calls only if asked for."""
        said = asdict(self)
        del said["explained"], said["timing"]  # they change no output
        if not self.strict_calls:
            del said["strict_calls"]
        if self.path_mm is None:
            del said["path_mm"], said["max_inserted"], said["take_up"]
        if not self.approach:
            del said["approach"]
        return said

    def times(self, visits: int) -> bool:
        """Tell whether a program of so many visits is run in time."""
        if self.inserts:
            return True
        return visits <= IN_TIME if self.timing is None else self.timing


IN_TIME = 5_000  # visits
AS_USUAL = Options()

# Seconds spent in every stage.

Progress = Callable[[str], None]


def silent(stage: str) -> None:
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
class Setting:
    """What a program is compensated with.

    Attributes:
        cell: The robot's surroundings, with the play that was measured.
        model: The arm's error.
        options: What the user asked for.
        clock: Times the stages.
        processes: How many may work at once; the result is the same.
    """

    cell: Cell
    model: Model
    options: Options
    clock: Clock
    processes: int = 1

    def timed_by(self, clock: Clock) -> Setting:
        """Return the same with another clock."""
        return replace(self, clock=clock)

    @cached_property
    def offset(self) -> Floats:
        """By what every joint is moved for its constant zero error, (6,) [rad]."""
        return -self.model.joint_offset(self.cell.arm)

    @cached_property
    def gap(self) -> Floats:
        """Half the fitted gap between the flanks of every joint, (6,) [rad]."""
        from postproc.model.play import half_gap

        return half_gap(self.model, self.cell.arm)

    @property
    def temperature(self) -> float:
        """The arm's temperature [deg C], NaN where nobody knows."""
        given = self.options.temperature
        return self.cell.temperature if given is None else given
