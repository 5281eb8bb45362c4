"""Diagnosing a measured path: flanks in motion, and what the model lacks on the way."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import Bools, Floats, Ints
from postproc.calibration.diagnosis.diagnose import Extension, extend_model
from postproc.calibration.diagnosis.files import REGISTERED
from postproc.calibration.diagnosis.investigate import no_progress
from postproc.calibration.diagnosis.search import Progress
from postproc.calibration.measurements import POSITION, Measurements
from postproc.calibration.survey_files import frame_of
from postproc.calibration.tables import (
    DETECT,
    TableFormat,
    read_foreign,
)
from postproc.compensation.paths.backlash_steps import (
    JointInMotion,
    in_motion,
    measure_steps,
)
from postproc.compensation.paths.path_error import PredictedWays, predict_ways
from postproc.compensation.paths.servo_lag import ServoLag, servo_lag
from postproc.compensation.paths.track_alignment import Aligned, OnTheWay, Track, align
from postproc.compensation.program import read_program, with_measured_play
from postproc.compensation.program_files import read_files
from postproc.compensation.solver.targets import targets_from_visits
from postproc.exceptions import MeasurementError, PostprocError
from postproc.language.visits import Visits
from postproc.model.model import READING, Model, as_model
from postproc.model.provenance import Provenance
from postproc.model.statistics import ErrorStatistics
from postproc.motion.cycle_time import ProgramCycle, run
from postproc.robot.cell import Cell, PointFrame, as_cell
from postproc.robot.pose import MM, inverse, lengths
from postproc.robot.state import States, make_states

COLUMNS = ("time_s", *POSITION)
LEAST = 100  # readings
RATES = (20.0, 2000.0)  # [Hz]
APART = 0.02  # [m] between readings on the way that enter the fit, at least
MOST = 1500  # of them
FOUND = 0.5  # of the program's stops, at least


@dataclass(frozen=True)
class PathDiagnosis:
    """What a measured path says.

    Attributes:
        name: The file.
        readings: How many it holds.
        rate: In a second [Hz].
        scatter: Standard deviation of a coordinate of one [m].
        stops: Stops of the program, found and not found.
        moves: Moves that readings were laid along.
        across: Distances across the way from where the model has it.
        joints: What the joints do where they change their flanks.
        extension: What the model lacks, from stops and from what lies across the ways.
        on_the_way: Rows of that which were read in motion.
        lag: What bends of the ways tell of the servos' lag.
    """

    name: str
    readings: int
    rate: float
    scatter: float
    stops: tuple[int, int]
    moves: int
    across: ErrorStatistics
    joints: tuple[JointInMotion, ...]
    extension: Extension
    on_the_way: int
    lag: ServoLag

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data, lengths in mm."""
        joints = [
            {"joint": j.joint, "steps": j.steps,
             "predicted_mm": round(j.predicted / MM, 5), "share": round(j.share, 4),
             "share_error": round(j.error, 4), "later_mm": round(j.later / MM, 3),
             "later_error_mm": round(j.later_error / MM, 3),
             "verdict": j.verdict}
            for j in self.joints
        ]  # fmt: skip
        return {
            "file": self.name,
            "readings": self.readings,
            "rate_hz": round(self.rate, 3),
            "scatter_mm": round(self.scatter / MM, 5),
            "stops_found": self.stops[0],
            "stops_missed": self.stops[1],
            "moves": self.moves,
            "across_mm": asdict(self.across),
            "flanks": joints,
            "rows_on_the_way": self.on_the_way,
            "along": None,  # the tracker's clock is its own
            "lag_ms": _number(1e3 * self.lag.seconds),
            "lag_below_ms": _number(1e3 * self.lag.most),
        }


def _number(value: float) -> float | None:
    """Round a number; None where it is none."""
    return round(value, 2) if np.isfinite(value) else None


def diagnose_path(
    track: Path,
    *,
    cell: Cell | str | Path,
    model: Model | str | Path,
    program: str | Path | None,
    frame: PointFrame | None = None,
    seed: int = 0,
    progress: Progress = no_progress,
) -> PathDiagnosis:
    """Lay a tracker's readings along a program's ways, and diagnose what they say.

    Args:
        track: Columns time_s, x_mm, y_mm, z_mm, read while the program ran once.
        cell: The cell, or its file.
        model: The model that may lack something, or its file.
        program: The program that ran.
        frame: What positions are given in; default: as `diagnose` has it.
        seed: Of the bootstrap.
        progress: Told what is being done.

    Raises:
        PostprocError: A file cannot be used, or the model cannot be extended.
    """
    if program is None:
        raise PostprocError(
            "--path: the program that ran is not given. Name it with --program"
        )
    cell = as_cell(cell)
    model, frame = as_model(model, cell.arm), frame_of(cell, frame)
    return _diagnose_track(track, cell, model, Path(program), frame, seed, progress)


def _diagnose_track(
    track: Path,
    cell: Cell,
    model: Model,
    program: Path,
    frame: PointFrame,
    seed: int,
    progress: Progress,
) -> PathDiagnosis:
    """Diagnose a track of a program in a cell."""
    read, digest = read_track(track, DETECT.within(cell))
    read = replace(read, position=_in_base(read.position, frame, cell, model))
    visits = read_program(read_files(program), cell).visits
    own = with_measured_play(cell, model)
    cycle = run(own.arm, targets_from_visits(visits, own)[0])
    ways = predict_ways(cycle, own, model, cell.temperature)
    found = align(read, ways, visits.motion.fly)
    _check(found, track, frame)
    joints = in_motion(measure_steps(ways, found.on_the_way, read.scatter))
    visit = ways.visit[_move(np.arange(len(ways.q)), ways)]
    nominal = own.arm.tcp(ways.q, cycle.targets.tool[visit, :3, 3])
    lag = servo_lag(
        ways, nominal, found.on_the_way, visits.motion.fly & ~visits.motion.via
    )
    rows = _rows(found, ways, visits, cycle, cell)
    survey = Measurements(
        track, rows.states, rows.position, rows.ids, np.zeros(len(rows.ids), np.int64),
        np.zeros(len(rows.ids), dtype=bool), digest,
    )  # fmt: skip
    tracker, setup = cell.tracker, tuple[str, ...]()
    if frame == "tracker" and model.registration is not None:
        tracker, setup = model.registration.tracker, REGISTERED
    extension = extend_model(
        survey, cell.arm, model, tracker=tracker, setup=setup, seed=seed,
        progress=progress,
    )  # fmt: skip
    extension = _as_surveyed(extension, model, joints)
    named = replace(extension.model, provenance=Provenance.today(cell))
    extension = replace(extension, model=named)
    size = ErrorStatistics.of_sizes(lengths(found.on_the_way.off))
    moves = np.unique(_move(found.on_the_way.sample, ways))
    stops = len(found.ended), found.missed
    return PathDiagnosis(
        track.name, len(read.time), 1.0 / read.period, read.scatter, stops,
        len(moves), size, joints, extension, rows.moving, lag,
    )  # fmt: skip


def read_track(path: Path, reading: TableFormat = DETECT) -> tuple[Track, str]:
    """Read a tracker's track; return its hash besides.

    Args:
        path: The file.
        reading: What the user knows of it.

    Raises:
        MeasurementError: Columns are missing, or the times are none.
    """
    table = read_foreign(path, reading)
    table.require(*COLUMNS)
    time = table.numbers("time_s")
    cure = "Give readings of one run, in order, with their times in seconds"
    if len(time) < LEAST:
        problem = f"holds {len(time)} readings: that is no path"
        raise MeasurementError(path, problem, cure)
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        line = int(table.line[late[0] + 1])
        raise MeasurementError(path, "time does not go on", cure, line=line)
    track = Track(time, table.block(POSITION) * MM)
    if not RATES[0] <= 1.0 / track.period <= RATES[1]:
        problem = f"has {1.0 / track.period:.3g} readings in a second"
        cure = (
            f"A path needs {RATES[0]:.0f} to {RATES[1]:.0f}, with times in seconds. "
            "Give the readings of a tracker that followed the tool"
        )
        raise MeasurementError(path, problem, cure)
    return track, hashlib.sha256(path.read_bytes()).hexdigest()


def _in_base(position: Floats, frame: PointFrame, cell: Cell, model: Model) -> Floats:
    """Convert readings to the arm's base frame.

    Raises:
        MeasurementError: Where the tracker stood is not known.
    """
    if frame == "uframe":
        T = inverse(cell.base.pose) @ cell.uframe.pose
        return np.asarray(position @ T[:3, :3].T + T[:3, 3])
    if frame != "tracker":
        return position
    if model.registration is None:
        problem = "the model does not know where the tracker stood"
        cure = "Fit it in the tracker's frame, or give positions in the base frame"
        raise MeasurementError(cell.path, problem, cure)
    return model.registration.to_base(position)


def _check(found: Aligned, path: Path, frame: str) -> None:
    """Refuse a track that is not of this program.

    Raises:
        MeasurementError: Too few of its stops are where the program has them.
    """
    expected = len(found.ended) + found.missed
    if len(found.ended) < max(FOUND * expected, 2) or not len(found.on_the_way):
        raise MeasurementError(
            path,
            f"{len(found.ended)} of the program's {expected} stops were found in it",
            f"Give the program that ran, and the frame of the readings ({frame} now); "
            "the arm has to stand still for 0.1 s at a stop",
        )


@dataclass(frozen=True)
class _Rows:
    """Rows for the fit: those at stops, then those that were read in motion."""

    states: States
    position: Floats
    ids: tuple[str, ...]
    moving: int


def _rows(
    found: Aligned,
    ways: PredictedWays,
    visits: Visits,
    cycle: ProgramCycle,
    cell: Cell,
) -> _Rows:
    """Make rows of a track: whole ones at stops, elsewhere what lies across the way."""
    at = ways.first[found.ended + 1] - 1
    on = found.on_the_way[_choose_readings(found.on_the_way, ways)]
    q = ways.q[on.sample]
    q = q + on.share[:, None] * (ways.q[np.minimum(on.sample + 1, len(ways.q) - 1)] - q)
    sample = np.concatenate([at, on.sample])
    time = np.concatenate([found.time, on.time])
    order = np.argsort(time, kind="stable")
    visit = ways.visit[_move(sample, ways)]
    speed = cycle.targets.linear_speed[visit] * cycle.targets.override[visit]
    states = make_states(
        np.concatenate([ways.q[at], q]),
        np.clip(np.round(ways.side[sample], 6), -1.0, 1.0),
        cycle.targets.tool[visit, :3, 3],
        speed=speed,
        time=time - time.min(),
        temperature=cell.temperature,
        payload=cell.payload_mass,
        payload_com=cell.payload_com,
        heading=np.concatenate([np.full((len(at), 3), np.nan), on.heading]),
    )[order]
    position = np.concatenate([found.standing, on.position])[order]
    line = visits.place.line[visit].tolist()
    ids = [f"line {n} stop" for n in line[: len(at)]]
    ids += [f"line {n} at {t:.2f} s"
            for n, t in zip(line[len(at) :], on.time, strict=True)]  # fmt: skip
    states = states.with_(order=np.arange(len(order), dtype=float))
    return _Rows(states, position, _distinct([ids[k] for k in order]), len(on))


def _distinct(ids: Sequence[str]) -> tuple[str, ...]:
    """Number ids that stand several times."""
    seen: dict[str, int] = {}
    out = []
    for name in ids:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(out)


def _choose_readings(read: OnTheWay, ways: PredictedWays) -> Ints:
    """Choose readings with sure sides that lie well apart, (k,)."""
    next_ = np.minimum(read.sample + 1, len(ways.q) - 1)
    rows = np.flatnonzero(_resting(ways, read.sample) & _resting(ways, next_))
    move = _move(read.sample[rows], ways)
    step = lengths(np.diff(read.position[rows], axis=0, prepend=read.position[:1]))
    place = np.floor(np.cumsum(step) / APART)
    new = np.append(True, (np.diff(place) > 0) | (np.diff(move) > 0))[: len(rows)]
    rows = rows[new]
    return np.asarray(rows[:: max(int(np.ceil(len(rows) / MOST)), 1)])


def _resting(ways: PredictedWays, sample: Ints) -> Bools:
    """Tell where all joints rest on flanks that are known, (n,)."""
    flanks = np.abs(ways.side[sample]) > 0.999
    return np.asarray(ways.sure[sample] & flanks.all(axis=1))


def _move(sample: Ints, ways: PredictedWays) -> Ints:
    """Return the moves that samples belong to, (n,)."""
    return np.asarray(np.searchsorted(ways.first, sample, side="right") - 1)


def _as_surveyed(
    found: Extension, model: Model, joints: tuple[JointInMotion, ...]
) -> Extension:
    """Leave what one run tells nothing of: how poses repeat, where a tracker stood."""
    *earlier, record = found.model.history
    record = {**record, "in_motion": {str(j.joint): j.verdict for j in joints}}
    told = {k: v for k, v in model.statistics.items() if k == READING}
    kept = replace(
        found.model,
        noise=model.noise,
        registration=model.registration,
        statistics=found.model.statistics | told,
        history=(*earlier, record),
    )
    return replace(found, model=kept)
