"""Frames that were taught with the arm contain its error: where they really are.

Whoever teaches a frame drives the tool to three points of the part. The controller
takes them to be where its nominal arm says; the tool really was where the arm lands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import Floats
from postproc.compensation.program import PlannedProgram
from postproc.diagnostics import Code, Reason
from postproc.exceptions import CellError
from postproc.language.visits import Meaning, Visits
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.robot.pose import MM, pose_from_record
from postproc.robot.state import make_states

SAME = 1e-9  # [m] and in rotation matrices: the frame of the cell
APART_MM, APART_DEG = 1.0, 0.1  # a frame of three points may differ by rounding only
_NO_POINTS = Reason(
    Code.TAUGHT_FRAME,
    "its user frame was taught with the arm and contains its error: give taught_deg in "
    "the cell file (the joint angles of its three points), or measure the frame",
)
_OUTSIDE = Reason(
    Code.TAUGHT_FRAME,
    "the points of its taught user frame lie outside of what was surveyed",
)
_OTHER = "its {} was taught with the arm and contains its error: measure it"


def correct_taught(
    planned: PlannedProgram, visits: Visits, cell: Cell, model: Model
) -> PlannedProgram:
    """Find where targets in taught frames really are; say which cannot be known.

    Args:
        planned: The program's plan, in the controller's frames.
        visits: The program.
        cell: Says which frames were taught, and at which joint angles.
        model: The arm's error, in the state of the cell.

    Raises:
        CellError: The points of a frame do not give that frame.
    """
    listed = find_taught_records(visits, cell)
    taught = sorted({*listed, *np.flatnonzero(visits.frame.taught).tolist()})
    if not taught:
        return planned
    poses = np.isin(visits.target.meaning, (Meaning.POSE, Meaning.NEAR))
    shift, variance = np.array(planned.shift), np.array(planned.shift_variance)
    for frame in taught:
        for column, name in ((visits.frame.tool, "tool"), (visits.frame.base, "base")):
            other = Reason(Code.TAUGHT_FRAME, _OTHER.format(name))
            planned.reasons.mark(column == frame, other)
        rows = poses & (visits.frame.uframe == frame)
        record = listed.get(frame, ())
        joints = cell.taught_frames.get(record)
        if joints is None:
            planned.reasons.mark(rows, _NO_POINTS)
            continue
        really, inside = find_moved_frame(joints, record, cell, model)
        if not inside:
            planned.reasons.mark(rows, _OUTSIDE)
        shift[rows], variance[rows] = really.shift(planned.plan.tcp[rows, :3, 3])
    return replace(planned, shift=shift, shift_variance=variance)


def find_taught_records(visits: Visits, cell: Cell) -> dict[int, tuple[float, ...]]:
    """Find the frames of a program that the cell lists as taught.

    Returns:
        The record that the cell has, by index into `Visits.frames`.
    """
    records = list(cell.taught_frames)
    if not records or not len(visits.frame.poses):
        return {}
    poses = pose_from_record(np.array(records))
    apart = np.abs(visits.frame.poses[:, None] - poses).max(axis=(2, 3))
    frame, record = np.nonzero(apart <= SAME)
    return {f: records[r] for f, r in zip(frame.tolist(), record.tolist(), strict=True)}


@dataclass(frozen=True)
class TaughtFrame:
    """A taught frame, as the controller has it and as its points really span it.

    Attributes:
        spanned: As the controller has it, in the arm's base frame, (4, 4) [m].
        points: Where its points really were, in the base frame, (3, 3) [m].
        std: Standard error of that, (3, 3) [m]: what the model does not know, and the
            backlash of joints whose side is not known.
    """

    spanned: Floats
    points: Floats
    std: Floats

    def shift(self, tcp: Floats) -> tuple[Floats, Floats]:
        """Tell how far positions in the frame are from where the controller has them.

        The points are taken to be off independently of each other.

        Args:
            tcp: Positions, (n, 3) [m], in the base frame.

        Returns:
            The shift (n, 3) [m], and its variance (n, 3) [m^2].
        """
        inside = (tcp - self.spanned[:3, 3]) @ self.spanned[:3, :3]
        at, variance = self._place(self.points, inside), np.zeros_like(tcp)
        for k in np.ndindex(3, 3):
            points = self.points.copy()
            points[k] += self.std[k]
            variance += np.square(self._place(points, inside) - at)
        return at - tcp, variance

    @staticmethod
    def _place(points: Floats, inside: Floats) -> Floats:
        """Place positions of a frame where three points have it, (n, 3) [m]."""
        pose = frame_of_points(points)
        return np.asarray(inside @ pose[:3, :3].T + pose[:3, 3])


def find_moved_frame(
    joints: Floats, record: tuple[float, ...], cell: Cell, model: Model
) -> tuple[TaughtFrame, bool]:
    """Find the frame that the points of a taught frame really span.

    Args:
        joints: Joint angles at its three points, (3, 6) [rad].
        record: The frame as the controller has it [mm, deg].
        cell: Tool and base with which it was taught.
        model: The arm's error.

    Returns:
        The frame, and whether the points lie inside of what was surveyed.

    Raises:
        CellError: The points do not give the frame.
    """
    arm, base = cell.arm, cell.base.pose
    nominal = (arm.flange(joints) @ cell.tool.pose)[:, :3, 3]
    states = make_states(
        joints,
        cell.taught_sides.get(record),
        tool=cell.tool.pose[:3, 3],
        temperature=cell.temperature,
        payload=cell.payload_mass,
        payload_com=cell.payload_com,
    )
    predicted = model.predict(arm, states)
    spanned = frame_of_points(nominal)
    _check(base @ spanned, pose_from_record(np.array([record]))[0], cell)
    really = TaughtFrame(spanned, nominal + predicted.error, predicted.std_arrival)
    inside = not any(mask.any() for mask in predicted.outside.values())
    return really, inside


def frame_of_points(points: Floats) -> Floats:
    """Return the frame (4, 4) with its origin, a point on +x and one at +y, (3, 3)."""
    x = points[1] - points[0]
    z = np.cross(x, points[2] - points[0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 2] = x / np.linalg.norm(x), z / np.linalg.norm(z)
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = points[0]
    return pose


def _check(spanned: Floats, frame: Floats, cell: Cell) -> None:
    """Refuse joint angles that do not give the frame."""
    away = np.linalg.norm(spanned[:3, 3] - frame[:3, 3]) / MM
    cosine = (np.trace(spanned[:3, :3].T @ frame[:3, :3]) - 1.0) / 2.0
    turned = np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if not (away <= APART_MM and turned <= APART_DEG):
        raise CellError(
            cell.path,
            f"the points of taught_deg give another frame, {away:.2f} mm and "
            f"{turned:.2f} deg from the one that is written",
            "Give origin, a point on +x and one at +y, taught with [tool] and [base]",
            place="$.uframe.taught_deg",
        )
