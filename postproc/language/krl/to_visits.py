"""From the arrivals of a KRL job to `Visits`."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from typing import Any

from postproc.diagnostics import NO_REASON, Code, Reason
from postproc.language.analysis import to_visits
from postproc.language.analysis.conditions import NO_LOAD, Conditions, Zone, cell_pose
from postproc.language.analysis.found_goals import FoundGoal, FoundVisit, not_reached
from postproc.language.analysis.to_visits import Arrival, zone_at
from postproc.language.krl import modal_state
from postproc.language.krl.interpreter import KrlMachine
from postproc.language.krl.moves import NO_SLOTS, NOTHING, PARTIAL, KrlVisit
from postproc.language.krl.pose_encoding import COMMENTS, KRL_DIALECT
from postproc.language.krl.syntax import SplineBlock
from postproc.language.shifts import Pose
from postproc.language.visits import Blend, Meaning, OrientationLaw, Switch
from postproc.robot.trajectory import Motion

_IPO = Reason(Code.FRAME_UNKNOWN, "$IPO_MODE is not known here")
_STATUS = Reason(
    Code.CONFIGURATION_UNKNOWN,
    "bit 2 of S and bit 4 of T disagree, otherwise than at the other points",
)
_STILL_TOOL = Reason(
    Code.ORIENTATION_LAW,
    "$ORI_TYPE = #CONSTANT: the tool keeps the orientation it comes with",
)
_NOT_TURNED = {
    "#constant": _STILL_TOOL,
    "#ignore": Reason(
        Code.ORIENTATION_LAW, "$ORI_TYPE = #IGNORE: the tool does not turn to the point"
    ),
}
_MAY_NOT_TURN = Reason(
    Code.ORIENTATION_LAW,
    "which orientation the tool takes is not known here ($ORI_TYPE)",
)
TURNING = ("#var", "#joint")  # ways to the orientation of a point
_SWAPPED = Reason(
    Code.FRAME_UNKNOWN,
    "$TOOL and $BASE were set with IPO_FRAME #TCP, which swaps them on some "
    "controllers: set them again with #BASE",
)
_NOT_SET = "an inline setting (WITH) is not known"


class KrlCollector(to_visits.TaskCollector):
    """Makes the visits of a KRL job."""

    dialect, comments = KRL_DIALECT, COMMENTS

    def __init__(self, machine: KrlMachine) -> None:
        """Find what ways to other arrivals tell of each."""
        runs: Sequence[FoundVisit] = machine.visits
        found: list[Any] = [v for run in runs for v in run.arrivals]
        self.effective = {id(v): _effective(machine, v) for v in found}
        _keep_orientation(found, self.effective)
        _follow_partial(machine, runs, found)
        super().__init__(machine)
        self.krl, self.base = machine, cell_pose(machine.task.start.base)
        self.ends, self.odd = _ends(runs, machine.lost), _odd_status(found)
        self.number = {id(v): k for k, run in enumerate(runs) for v in run.arrivals}

    def arrive(self, v: KrlVisit) -> Arrival:
        """Say what an arrival is carried out with."""
        machine, at = self.krl, self.number[id(v)]
        modes, unset = self.effective[id(v)]
        joint = v.motion == Motion.JOINT
        active = {why for _, why in modes.active}
        early = machine.early.get(at, frozenset())
        blocked = modes.blocked | active | machine.everywhere | early
        if "track" not in machine.task.start.aux.values():
            blocked -= modal_state.OF_TRACK
        given = (*sorted(blocked), v.why, v.goal.why, unset, modes.tool.why)
        if v.goal.target != Meaning.JOINTS:
            given += (modes.base.why, NO_REASON if modes.interpolation else _IPO)
            # Frames that were set for a fixed tool hold for no other move.
            remote = modes.tool.remote or modes.base.remote
            swapped = remote and modes.interpolation != "#tcp"
            given += (_SWAPPED if swapped else NO_REASON,)
        given += (_STATUS if id(v) in self.odd else NO_REASON,)
        lost = modes.load == modal_state.LOST_LOAD
        given += (modal_state.UNKNOWN_LOAD if lost else NO_REASON,)
        conditions = Conditions(
            tool=modes.tool.pose,
            base=self.base,
            uframe=modes.base.pose,
            taught=(modes.tool.taught, False, modes.base.taught),
            tool_remote=modes.interpolation == "#tcp",
            care=(Switch.ON if joint else Switch.OFF,) * 3,
            orientation_law=_law(v, modes),
            zone=_zone(v, modes, self.ends[at]),
            linear=modes.speed if modes.speed > 0 else math.nan,
            wrist_joint=modes.law == OrientationLaw.WRIST_JOINTS and not joint,
            override=modes.share if joint and modes.share > 0.0 else 1.0,
            load=_load(modes),
        )
        flies = conditions.zone.blend != Blend.UNSET
        flagged = joint and v.goal.target == Meaning.POSE
        return Arrival(conditions, given, flagged, flies)


def _effective(machine: KrlMachine, v: KrlVisit) -> tuple[modal_state.KrlModes, Reason]:
    """Add what a move sets for itself; say where that is not known."""
    modes: modal_state.KrlModes = v.modes
    given = [(v.scope, one) for one in v.move.settings]
    if v.begin >= 0:
        block = machine.texts[v.scope.file].statement(v.begin)
        assert isinstance(block, SplineBlock)
        given = [(v.scope.at(v.begin), one) for one in block.settings] + given
    for here, setting in given:
        after = modal_state.ModeReader(machine.task, here).assign(modes, setting)
        if after is None:
            text = f"{_NOT_SET}: {setting.target.name.upper()}"
            return modes, Reason(Code.SETTING_UNTRACKED, text)
        modes = after
    return modes, NO_REASON


def _load(modes: modal_state.KrlModes) -> tuple[float, ...]:
    """Return what the program states that the arm carries, see `Conditions.load`."""
    unknown = not modes.load or modes.load == modal_state.LOST_LOAD
    return NO_LOAD if unknown else (*modes.load, *(math.nan,) * 3)[:4]


def _law(v: KrlVisit, modes: modal_state.KrlModes) -> OrientationLaw:
    """Tell how the tool turns on the way."""
    if v.motion != Motion.CIRCULAR or modes.orientation != "#var":
        return modes.law
    if modes.circle == "#path":
        return OrientationLaw.ALONG_PATH
    if v.by_spline_planner:
        law = OrientationLaw
        return law.ONE_AXIS if modes.through else law.ALONG_PATH
    known = modes.circle == "#base"
    return OrientationLaw.START_TO_END if known else OrientationLaw.ALONG_PATH


def _zone(v: KrlVisit, modes: modal_state.KrlModes, stops: bool | None) -> Zone:
    """Tell how a point is passed."""
    if v.inner and not v.via:
        return zone_at(v.via, exact=True)
    if v.via or not v.blends or stops or modes.ahead is False:
        return zone_at(v.via)
    unsized = zone_at(v.via, unsized=True)
    if stops is None or modes.ahead is None:
        return unsized
    words = v.move.words
    if "c_ptp" in words and "c_dis" not in words:
        known = modes.overlap != modal_state.UNKNOWN
        return zone_at(v.via, overlap=modes.overlap) if known else unsized
    by_distance = "c_dis" in words or "c_spl" in words
    if not by_distance or modes.distance == modal_state.UNKNOWN:
        return unsized
    return zone_at(v.via, modes.distance)


# What stands behind a point decides whether it is passed.


def _ends(runs: Sequence[FoundVisit], lost: Container[int]) -> list[bool | None]:
    """Tell of every visit whether the arm stops there, None where that is not sure.

    The old planner and that of splines do not blend into each other, statements that
    wait for what runs ahead stop the arm, and so does the end of the program.

    Args:
        runs: The visits; one planner makes all of a block, which ends by itself.
        lost: Those behind which the arm may go anywhere.
    """
    stops = [set[bool | None]([None] if k in lost else ()) for k in range(len(runs))]
    for run in runs:
        after: Any = run.arrivals[0]
        for origin in (k for k in run.origins if k >= 0):
            before: Any = runs[origin].arrivals[0]
            stop: bool | None = run.modes.halted
            if after.by_spline_planner != before.by_spline_planner:
                stop = True
            elif after.modes.ahead != before.modes.ahead and not stop:
                stop = None  # whether the program waits between them is not known
            stops[origin].add(stop)
    return [True if s <= {True} else False if s == {False} else None for s in stops]


def _keep_orientation(
    found: Sequence[KrlVisit],
    effective: Mapping[int, tuple[modal_state.KrlModes, Reason]],
) -> None:
    """Forget targets whose orientation the tool does not take.

    Args:
        found: The visits.
        effective: What each is made with, by identity, see `_effective`.
    """
    for v in found:
        modes, _ = effective[id(v)]
        if modes.orientation not in TURNING and v.motion != Motion.JOINT:
            lost = modes.tool.why or modes.base.why or _MAY_NOT_TURN
            why = v.goal.why or _NOT_TURNED.get(modes.orientation, lost)
            v.goal = not_reached(v.goal, why)


def _follow_partial(
    machine: KrlMachine, runs: Sequence[FoundVisit], found: Sequence[KrlVisit]
) -> None:
    """Forget where missing numbers lead that are not sure to be those before.

    They are not where X, Y, Z were commanded in other frames, or behind an arc that
    ends elsewhere than at the point that is written.
    """
    partial = (Meaning.PARTIAL_POSE, Meaning.PARTIAL_JOINTS)
    for v in (v for v in found if v.goal.target in partial):
        origins = machine.list_visits(v.origins)
        before: list[Any] = [runs[k].arrivals[0] for k in origins]
        lost = any(one.move.angle is not None for one in before)
        if v.goal.target == Meaning.PARTIAL_POSE:
            own = _frames(machine, v)
            lost |= own is None or any(_frames(machine, one) != own for one in before)
        if lost:
            v.goal = FoundGoal(Meaning.UNKNOWN, NOTHING, slots=NO_SLOTS, why=PARTIAL)


def _frames(machine: KrlMachine, v: KrlVisit) -> tuple[Pose, Pose, str] | None:
    """Return tool, base and kind of interpolation of a move, None where not known."""
    modes, unset = _effective(machine, v)
    tool, base, kind = modes.tool, modes.base, modes.interpolation
    known = tool.pose and base.pose and kind
    return (tool.pose, base.pose, kind) if known and not (unset or base.why) else None


def _odd_status(found: Sequence[KrlVisit]) -> set[int]:
    """Find joint moves, by identity, whose S says another side of axis 5 than T does.

    What bit 2 of S means is told by most of the program's own points; where they do
    not agree at all, all are odd.
    """
    agree: Mapping[bool, dict[int, int]] = {True: {}, False: {}}
    for v in found:
        if v.motion == Motion.JOINT and v.goal.target == Meaning.POSE:
            s, t = v.goal.values[6:]
            agree[bool(int(s) & 4) == bool(int(t) & 16)][id(v)] = v.count
    more, less = sorted(agree.values(), key=lambda one: sum(one.values()), reverse=True)
    alike = sum(more.values()) == sum(less.values())
    return {*more, *less} if alike else {*less}
