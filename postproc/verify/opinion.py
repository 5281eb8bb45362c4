"""What is judged, and what comes of it: claims of the planner, rows of a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Self

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.language.visits import Visits
from postproc.robot.arm_file import ArmFile

COUNTED = "counted"  # unit of a row that compares nothing
NOT_KNOWN = "not known to the planner, or no pose"
TIME_UP = "the time was up"


@dataclass(frozen=True)
class ArmFacts:
    """What the second opinion takes from arm file and cell, as numbers.

    Attributes:
        file: The arm file.
        weight: Direction in which weight pulls, unit vector, (3,), base frame.
        play: Of every joint on the drive side, (6,) [rad].
        home, calibration: Joint angles, (6,) [rad], or None.
        elbow, wrist_centre: Most that they may move by a correction [m].
    """

    file: ArmFile
    weight: Floats
    play: Floats
    home: Floats | None
    calibration: Floats | None
    elbow: float
    wrist_centre: float


@dataclass(frozen=True)
class Allowance:
    """Time for a second opinion.

    Attributes:
        positions: For the places of targets, and what goes with them [s].
        ways: For the ways between them [s].
    """

    positions: float = 60.0
    ways: float = 60.0

    def less(self, opinion: Opinion) -> Allowance:
        """Return what one opinion leaves for the next."""
        positions = opinion.seconds - opinion.on_ways
        return Allowance(self.positions - positions, self.ways - opinion.on_ways)


DIRECTIONS = "approach directions"  # the row that lambda is judged in
ENOUGH = Allowance()


@dataclass(frozen=True)
class Claim:
    """What the planner says of the n visits of a program.

    Attributes:
        label: "source" or "output".
        visits: The program, as the language reads it.
        q: Joint angles at the targets themselves, (n, 6) [rad], NaN where not known.
        direction: lambda that the targets are corrected for, (n, 6).
        slot: Branch 4 W + 2 S + E, (n,), -1 where it was not looked up.
        singular: Smallest singular value of the flange's Jacobian, (n,).
        payload: Mass [kg] and centre in the flange frame [m], (n, 4); mass 0: none.
        torque: Gravity torques, (n, 6) [N m]; empty where no link has a mass.
        time: Since the first move, along the first predecessors, (n,) [s], NaN where
            not known.
        within: 1 where all joints stay within their limits on the way, -1 where one is
            beyond, 0 where that is not known, (n,).
        own: Visits that the source makes too, (k,).
    """

    label: str
    visits: Visits
    q: Floats
    direction: Floats
    slot: Ints
    singular: Floats
    payload: Floats
    torque: Floats
    time: Floats
    within: Ints
    own: Ints

    def __len__(self) -> int:
        """Return the number of visits."""
        return len(self.visits)

    def place(self, visit: int) -> str:
        """Name the line of a visit's move."""
        v = self.visits
        return f"{self.label} {v.file_name(visit)}:{int(v.place.line[visit])}"


@dataclass(frozen=True)
class OpinionRow:
    """One row of the table.

    Attributes:
        what: What was compared.
        unit: Of `largest` and `bound`.
        compared: How many values.
        beyond: How many of them differ by more than the bound.
        largest: The largest difference.
        bound: What differs by more disagrees.
        where: The place of the largest difference, or "".
        skipped: How many values were not compared, by reason.
    """

    what: str
    unit: str
    compared: int
    beyond: int
    largest: float
    bound: float
    where: str
    skipped: Mapping[str, int] = field(default_factory=dict)

    def with_more(self, row: OpinionRow) -> OpinionRow:
        """Add what was compared in another program."""
        worst = max(self, row, key=lambda r: (r.beyond > 0, r.largest))
        skipped = Counter(self.skipped) + Counter(row.skipped)
        return replace(
            worst,
            compared=self.compared + row.compared,
            beyond=self.beyond + row.beyond,
            skipped=dict(skipped),
        )


@dataclass(frozen=True)
class Opinion:
    """What the second opinion says of a program.

    Attributes:
        program: Its name.
        rows: What was compared.
        seconds: Time that it took.
        on_ways: How much of it for ways, times and directions.
    """

    program: str
    rows: tuple[OpinionRow, ...]
    seconds: float
    on_ways: float = 0.0

    @property
    def agrees(self) -> bool:
        """Return True where no difference is beyond its bound."""
        return not any(row.beyond for row in self.rows)

    @property
    def empty(self) -> bool:
        """Return True where nothing was compared."""
        return not any(row.compared for row in self.rows)

    @property
    def directions(self) -> tuple[int, int]:
        """Count the approach directions that were compared, and all."""
        own = [row for row in self.rows if row.what.endswith(DIRECTIONS)]
        compared = sum(row.compared for row in own)
        return compared, compared + sum(sum(row.skipped.values()) for row in own)

    @classmethod
    def join(cls, name: str, opinions: Sequence[Opinion]) -> Self:
        """Put the tables of several programs into one."""
        found: dict[str, OpinionRow] = {}
        for row in (row for opinion in opinions for row in opinion.rows):
            old = found.get(row.what)
            found[row.what] = row if old is None else old.with_more(row)
        return cls(name, tuple(found.values()), sum(o.seconds for o in opinions))

    @classmethod
    def of_report(cls, told: Mapping[str, Any]) -> Self:
        """Take it out of a written report.

        Raises:
            KeyError, TypeError: It is none.
        """
        rows = tuple(OpinionRow(**row) for row in told["rows"])
        return cls(str(told["program"]), rows, float(told["seconds"]))

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        rows = [asdict(row) for row in self.rows]
        told = {"program": self.program, "agrees": self.agrees}
        return {**told, "seconds": round(self.seconds, 3), "rows": rows}


def compare(
    what: str,
    unit: str,
    bound: float,
    claim: Claim,
    size: Floats,
    late: Bools,
    unasked: Bools | None = None,
) -> OpinionRow:
    """Make a row from the differences at the visits, NaN where there is none.

    Args:
        what: What was compared.
        unit: Of the differences.
        bound: What differs by more disagrees.
        claim: Names the places.
        size: Differences, (n,).
        late: Visits for which there was no time, (n,).
        unasked: Visits of which nothing is expected, (n,): not counted as skipped.
    """
    lost = np.isnan(size) if unasked is None else np.isnan(size) & ~unasked
    skipped = Counter({TIME_UP: int((lost & late).sum())})
    skipped[NOT_KNOWN] = int((lost & ~late).sum())
    rows = np.flatnonzero(~np.isnan(size))
    sizes = list(zip(size[rows].tolist(), rows.tolist(), strict=True))
    return worst_of(what, unit, bound, claim, sizes, +skipped)


def worst_of(
    what: str,
    unit: str,
    bound: float,
    claim: Claim,
    sizes: Sequence[tuple[float, int]],
    skipped: Mapping[str, int],
) -> OpinionRow:
    """Make a row from differences and the visits that they are at."""
    worst, i = max(sizes, default=(0.0, -1))
    return OpinionRow(
        what, unit, len(sizes), sum(size > bound for size, _ in sizes), worst, bound,
        claim.place(i) if i >= 0 else "", dict(skipped),
    )  # fmt: skip
