"""From the arrivals of a RAPID task to `Visits`."""

from __future__ import annotations

import numpy as np

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis import to_visits
from postproc.language.analysis.conditions import (
    NO_LOAD,
    Conditions,
    TaskFrame,
    cell_pose,
    compose_poses,
)
from postproc.language.analysis.to_visits import Arrival, zone_at
from postproc.language.rapid.interpreter import RapidMachine
from postproc.language.rapid.modal_state import NO_SHIFT, UNKNOWN_SHIFT
from postproc.language.rapid.moves import (
    UNKNOWN_ZONE,
    RapidVisit,
    pose_of_numbers,
)
from postproc.language.rapid.pose_encoding import COMMENTS, RAPID_DIALECT
from postproc.language.shifts import Pose
from postproc.language.visits import Blend, Meaning
from postproc.robot.pose import MM
from postproc.robot.trajectory import Motion

_GRIP = Reason(
    Code.LOAD_UNKNOWN,
    "what the arm carries is not known here: call GripLoad after the statement that "
    "is not followed",
)
_PART_ALONE = Reason(
    Code.LOAD_UNKNOWN,
    "GripLoad states a part, and the tool states no mass of its own: what the arm "
    "carries in all is not known. State the mass in tooldata",
)
_SHIFT = Reason(
    Code.FRAME_UNKNOWN,
    "the program displacement is not known here: set it (PDispSet, PDispOff) after the "
    "statement that is not followed",
)


class RapidCollector(to_visits.TaskCollector):
    """Makes the visits of a RAPID task."""

    dialect, comments = RAPID_DIALECT, COMMENTS

    def __init__(self, machine: RapidMachine) -> None:
        """Place the arm as the cell says."""
        super().__init__(machine)
        self.base = cell_pose(machine.task.start.base)
        self.placed: dict[tuple[TaskFrame, Pose], Pose] = {}

    def arrive(self, v: RapidVisit) -> Arrival:
        """Say what an arrival is carried out with."""
        key = v.wobj, v.modes.shift
        if key not in self.placed:
            pose = v.wobj.pose if v.modes.shift != UNKNOWN_SHIFT else ()
            if pose and v.modes.shift != NO_SHIFT:
                pose = compose_poses(pose, pose_of_numbers(v.modes.shift))
            self.placed[key] = pose
        conditions = _conditions(v, self.base, self.placed[key])
        given = [*sorted(v.modes.blocked), v.why, v.goal.why, v.tool.why]
        if v.goal.target != Meaning.JOINTS:
            given.append(v.wobj.why)
            given.append(_SHIFT if v.modes.shift == UNKNOWN_SHIFT else NO_REASON)
        given.append(_explain_unknown_load(v))
        flies = conditions.zone.blend != Blend.UNSET
        return Arrival(conditions, given, v.goal.target == Meaning.POSE, flies)


def _conditions(v: RapidVisit, base: Pose, uframe: Pose) -> Conditions:
    """Say what an arrival is carried out with."""
    joint = v.motion == Motion.JOINT
    return Conditions(
        tool=v.tool.pose,
        base=base,
        uframe=uframe,
        taught=(v.tool.taught, False, v.wobj.taught),
        tool_remote=v.tool.remote or v.wobj.remote,
        care=(v.modes.confj if joint else v.modes.confl,) * 3,
        orientation_law=v.modes.arc_law if v.motion == Motion.CIRCULAR else v.modes.law,
        zone=zone_at(v.via, v.zone_mm, unsized=v.zone_mm == UNKNOWN_ZONE),
        linear=v.speed,
        wrist_joint=bool(v.modes.wrist) and not joint,
        override=v.modes.override if v.modes.override > 0.0 else 1.0,
        load=_load(v),
    )


def _load(v: RapidVisit) -> tuple[float, ...]:
    """Return what the program states that the arm carries, see `Conditions.load`."""
    if v.total:
        mass, *centre = v.total
        return mass, *(x * MM for x in centre)
    if not v.tool.load or not v.modes.grip or not v.tool.pose:
        return NO_LOAD
    mass, *own = v.tool.load
    carried, *part = v.modes.grip
    at = np.array(v.tool.pose).reshape(4, 4) @ np.array([*(x * MM for x in part), 1.0])
    centre = (mass * MM * np.array(own) + carried * at[:3]) / (mass + carried)
    return mass + carried, *centre.tolist()


def _explain_unknown_load(v: RapidVisit) -> Reason:
    """Say why it is not known what the arm carries."""
    if v.total:
        return NO_REASON
    if not v.modes.grip:
        return _GRIP
    alone = v.modes.grip[0] and not v.tool.load
    return _PART_ALONE if alone else NO_REASON
