"""From targets to the state of the arm at every arrival."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import Bools, Floats, Ints, read_only
from postproc.diagnostics import Reason
from postproc.motion.arrival_times import no_time
from postproc.motion.blending import blend
from postproc.motion.joint_path import NOWHERE, StartState, Trace, trace
from postproc.motion.path import BlendCoupling
from postproc.motion.replan import points_of_plan, where_passed
from postproc.motion.spline_moves import arrivals_on_curves
from postproc.motion.targets import CODE, REASONS, WRIST, Targets
from postproc.robot.arm import Arm
from postproc.robot.backlash_operator import PlayState
from postproc.robot.direction import UNLED, Arrivals, arrivals


@dataclass(frozen=True)
class Plan:
    """n arrivals in program order (structure of arrays), SI units, base frame.

    Attributes:
        q: Joint angles, (n, 6) [rad], NaN where not known; at a rounded fly point those
            of the point of the path that lies nearest to the target.
        tcp: Wanted TCP pose there, (n, 4, 4) [m], NaN where not known.
        aside: From the target to that place, (n, 3) [m]; 0 but at rounded fly points.
        tool: TCP in the flange frame, (n, 4, 4) [m].
        direction: Side every joint arrives from, (n, 6): +1, -1, or 0 where not known.
        side: Where every joint lies in its play, (n, 6) from -1 to 1; 0: not known.
        travel: Travel since the last reversal, (n, 6) [rad].
        speed: TCP speed at the target, (n,) [m/s]; 0 where the arm stops, NaN where
            nobody asked.
        time: Time since the first move along the first predecessors, (n,) [s].
        slot: Branch 4 W + 2 S + E, (n,), -1 where it was not looked up.
        reason: Index into `reasons`, (n,); 0 where the arrival may be compensated.
        reasons: Why not; reasons[0] is `NO_REASON`.
        overruled: Continuity took another branch or turn than the string says, (n,).
        untimed: Time and speed are estimates: no time law was found, (n,).
        pull: How rounded fly points move with their neighbours.
        past: What the joints remember at the arrivals, n rows.
        exact: The ways as if the arm stopped at every target.
    """

    q: Floats
    tcp: Floats
    aside: Floats
    tool: Floats
    direction: Floats
    side: Floats
    travel: Floats
    speed: Floats
    time: Floats
    slot: Ints
    reason: Ints
    reasons: tuple[Reason, ...]
    overruled: Bools
    untimed: Bools
    pull: BlendCoupling
    past: PlayState
    exact: Trace

    def __post_init__(self) -> None:
        read_only(self)

    def __len__(self) -> int:
        """Return the number of arrivals."""
        return len(self.q)

    def lead(self, rows: slice) -> Arrivals:
        """Return what is known of some arrivals for who goes on from them."""
        return Arrivals(self.direction, self.side, self.travel, self.past)[rows]

    def gravity_torque(self, arm: Arm, payload: float, payload_com: Floats) -> Floats:
        """Torque that gravity exerts about every joint, (n, 6) [N m].

        Args:
            arm: The arm.
            payload: Payload mass [kg].
            payload_com: Its centre of mass in the flange frame, (3,) [m].
        """
        return arm.gravity_torque(self.q, payload, payload_com)


def plan(
    arm: Arm,
    targets: Targets,
    wrist: float,
    timed: bool = True,
    begin: StartState = NOWHERE,
    lead: Arrivals = UNLED,
) -> Plan:
    """Plan every move the way the controller moves.

    Args:
        arm: The arm.
        targets: The moves.
        wrist: Axis 5 nearer to zero than this is the wrist singularity [rad].
        timed: Find out how fast the arm passes; else speed and time stay unknown.
        begin: Where the arm stands at the first move, if that is known beforehand.
        lead: What is known of the first arrivals, see `direction.arrivals`.
    """
    exact = trace(arm, targets, begin.known)
    traced = blend(arm, targets, exact, timed)
    arrived = arrivals(arm, traced.q, traced.driven, lead)
    arrived = arrivals_on_curves(arm, targets, traced.q, arrived)
    clock = no_time(len(targets))
    if timed:
        from postproc.motion.timing import tell_time  # with what only timed runs load

        clock = tell_time(arm, targets, traced)
    pull = BlendCoupling.of(traced.rounded, traced.edges.first, traced.edges.source)
    tool = targets.tool
    tcp = where_passed(arm, points_of_plan(exact), traced.q) @ tool
    return Plan(
        traced.q, tcp, traced.aside, tool, arrived.direction, arrived.side,
        arrived.travel, clock.speed, clock.time, traced.slot,
        _guard(traced, wrist), REASONS, traced.overruled, clock.untimed,
        pull, arrived.past, exact,
    )  # fmt: skip


def _guard(traced: Trace, wrist: float) -> Ints:
    """Add the wrist singularity to the reasons."""
    near = np.abs(traced.q[:, 4]) < wrist
    return np.where((traced.reason == 0) & near, CODE[WRIST], traced.reason)
