"""Every method on the same rows, tested on the same others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from postproc.calibration.baselines import (
    Comparison,
    Trial,
    blocks_of,
    compare_in,
    random_split,
    random_stated,
    span_of,
)
from postproc.calibration.fit import Frame, into_base_frame
from postproc.calibration.measurements import Measurements
from postproc.calibration.reversal_test import split_reversals
from postproc.calibration.stops import pool_readings
from postproc.calibration.survey_checks import check_survey
from postproc.calibration.survey_files import read_measurements, survey_frame
from postproc.calibration.tables import DETECT, TableFormat
from postproc.exceptions import PostprocError
from postproc.model.noise import poses_of
from postproc.robot.cell import Cell, as_cell


@dataclass(frozen=True)
class Held:
    """Which rows methods are tested on: a random third, unless something else is said.

    Attributes:
        files: Measurement files of their own.
        blocks: Or so many blocks of the rows in their order, one after the other.
        seed: Of the random split and of the random layers.
    """

    files: Sequence[Path] = ()
    blocks: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.files and self.blocks:
            raise PostprocError("--test and --cv-blocks: say one of them")

    def pairs(
        self, survey: Measurements, cell: Cell, reading: TableFormat
    ) -> tuple[list[tuple[Measurements, Measurements]], str]:
        """Return the rows to fit and to test, and in words what they are.

        Raises:
            PostprocError: A file cannot be used, or there are not as many rows.
        """
        if self.files:
            test = pool_readings(
                read_measurements(*self.files, cell=cell, reading=reading)
            )
            names = ", ".join(path.name for path in self.files)
            return [(survey, test)], (
                f"{len(survey)} rows to fit, {len(test)} of {names} to test"
            )
        if not self.blocks:
            train, held = random_split(poses_of(survey.states), self.seed)
            pairs = [(survey[train], survey[held])]
            return pairs, random_stated(train, held, self.seed)
        if not 2 <= self.blocks <= len(survey) // 2:
            raise PostprocError(
                f"--cv-blocks {self.blocks}: {len(survey)} rows can be cut into 2 to "
                f"{len(survey) // 2} blocks"
            )
        cut = blocks_of(len(survey), self.blocks)
        return [(survey[train], survey[held]) for train, held in cut], (
            f"{len(survey)} rows in {self.blocks} blocks in their order, each tested "
            "by a fit of the others"
        )


def compare_files(
    data: Sequence[Path],
    cell: Cell | str | Path,
    frame: Frame | None,
    held: Held,
    reading: TableFormat = DETECT,
) -> Comparison:
    """Fit and test every method on measurement files.

    Rows in the tracker's frame are registered by those that are fitted alone.

    Raises:
        PostprocError: A file cannot be used.
    """
    cell = as_cell(cell)
    frame = survey_frame(cell, frame)
    survey = pool_readings(read_measurements(*data, cell=cell, reading=reading))
    survey, _ = split_reversals(survey, cell.arm)
    pairs, said = held.pairs(survey, cell, reading)
    trials = [_trial(train, test, cell, frame) for train, test in pairs]
    for trial in trials:
        check_survey(trial.train, cell.arm)
    rows = compare_in(trials, cell.arm, held.seed)
    return Comparison(rows, said, span_of(survey.states))


def _trial(train: Measurements, test: Measurements, cell: Cell, frame: Frame) -> Trial:
    """Take rows into the base frame."""
    if frame != "tracker":
        return Trial(train, test, cell.tracker)
    train, found = into_base_frame(train, cell.arm)
    states = found.on_probes(test.states)
    position = found.to_base(test.position, states.station)
    test = replace(test, states=states, position=position)
    return Trial(train, test, found.origin)
