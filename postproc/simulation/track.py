"""What a tracker reads that follows the tool while the virtual arm runs a program."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from postproc.arrays import Floats
from postproc.files import write_all
from postproc.simulation.arm import VirtualArm
from postproc.simulation.controller import VirtualCell
from postproc.simulation.draw import stream
from postproc.simulation.program import SETTLE, DrivenMove, ProgramRun, gears_along
from postproc.simulation.state import make_arrivals

RATE = 100.0  # [Hz]
LEAD = (0.5, 2.0)  # [s] that the tracker reads before the program begins


@dataclass(frozen=True)
class VirtualTrack:
    """n readings of a tracker that follows the tool (structure of arrays).

    Attributes:
        time: By the tracker's own clock, (n,) [s].
        position: Readings, (n, 3) [m] in the arm's base frame.
    """

    time: Floats
    position: Floats

    def write(self, path: str | Path) -> None:
        """Write time_s, x_mm, y_mm, z_mm, whole or not at all.

        Raises:
            OutputError: The file cannot be written.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["time_s", "x_mm", "y_mm", "z_mm"])
        for t, place in zip(self.time, 1e3 * self.position, strict=True):
            writer.writerow([f"{t:.4f}", *(f"{v:.4f}" for v in place)])
        write_all({Path(path): text.getvalue().encode()})


def record_track(
    arm: VirtualArm, setup: VirtualCell, run: ProgramRun, rate: float = RATE
) -> VirtualTrack:
    """Read the tool's place all the while that a program runs.

    The tracker's clock begins some time before the program. The arm stands still after
    every move that does not fly, and begins and ends moves without ramps. What does
    not repeat of the joints is left out: within one run it changes slowly, if at all.

    Args:
        arm: The arm that runs it.
        setup: Its cell.
        run: The program that was run.
        rate: Readings in a second [Hz].
    """
    rng = stream(arm.seed, "track")
    lead = float(rng.uniform(*LEAD))
    moves = [_places(arm, setup, one, rate) for one in run.moves if not one.why]
    before = [np.repeat(move[:1], int(lead * rate), axis=0) for move in moves[:1]]
    real = np.concatenate([np.empty((0, 3)), *before, *moves])
    span = np.linalg.norm(real - setup.tracker, axis=1)
    sigma = arm.tracker_noise[0] + arm.tracker_noise[1] * span
    measured = real + rng.normal(size=real.shape) * sigma[:, None]
    return VirtualTrack(np.arange(len(real)) / rate, measured)


def _places(
    arm: VirtualArm, setup: VirtualCell, run: DrivenMove, rate: float
) -> Floats:
    """Place the tool at every reading of a move and of the stop behind it, (k, 3)."""
    q = _in_time(run.path, max(int(run.lasted * rate), 1))
    gears = {name: column[1:] for name, column in gears_along(arm, run, q).items()}
    time = run.begins + np.linspace(0.0, run.lasted, len(q))[1:]
    states = make_arrivals(
        q[1:], tool=run.tool, **gears, speed=run.speed,
        time=time, temperature=arm.temperature(time, setup.temperature),
        payload=setup.payload, payload_com=setup.payload_com,
    )  # fmt: skip
    places = arm.tcp(states)
    stands = 0 if run.flies else int(SETTLE * rate)
    return np.concatenate([places, np.repeat(places[-1:], stands, axis=0)])


def _in_time(path: Floats, count: int) -> Floats:
    """Take count + 1 places of a joint path, (m, 6), evenly along it."""
    step = np.linalg.norm(np.diff(path, axis=0), axis=1)
    path = path[np.append(True, step > 0)]
    if len(path) < 2:
        return np.repeat(path, count + 1, axis=0)
    marks = np.append(0.0, np.cumsum(step[step > 0]))
    u = np.linspace(0.0, marks[-1], count + 1)
    return np.asarray(CubicSpline(marks, path)(u))
