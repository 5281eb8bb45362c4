"""The arm: forward kinematics, Jacobians, gravity torque, inverse kinematics."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Floats, Ints, floats
from postproc.exceptions import ArmError
from postproc.robot.arm_file import ArmFile, arm_path, parse_toml, read_arm_file
from postproc.robot.inverse import (
    Branches,
    ClosedForm,
    Inverse,
    NumericForm,
    wrap,
)
from postproc.robot.pose import MM

# The Denavit-Hartenberg chain: frames and points along it, for many poses at once.


@dataclass(frozen=True)
class DH:
    """Standard D-H parameters; D-H angle = offset + sense * (mix @ q), each (6,)."""

    a: Floats  # [m]
    d: Floats  # [m]
    alpha: Floats  # [rad]
    offset: Floats  # [rad]
    sense: Floats
    mix: Floats  # (6, 6): geometric joint angles from the controller's

    def angles(self, q: Floats) -> Floats:
        """Convert controller angles (n, 6) to D-H angles (n, 6) [rad]."""
        theta: Floats = self.offset + self.sense * (q @ self.mix.T)
        return theta

    def pack(self, beta: Floats | None = None) -> Floats:
        """Return what the core knows of the chain, (12, 6).

        Args:
            beta: Hayati's rotations of the links, (6,) [rad].
        """
        beta = np.zeros(6) if beta is None else beta
        rows = self.a, self.d, self.alpha, self.offset, self.sense, beta, *self.mix.T
        return np.array(rows)

    def frames(self, q: Floats) -> Floats:
        """Place the link frames 0 (base) to 6 (flange): (n, 6) -> (n, 7, 4, 4)."""
        return _native.frames(self.pack(), floats(q)).reshape(len(q), 7, 4, 4)

    def flange(self, q: Floats) -> Floats:
        """Place the flange for angles (n, 6) [rad]: (n, 4, 4) [m]."""
        return _native.flange(self.pack(), floats(q))

    def place(self, q: Floats, point: Floats, beta: Floats | None = None) -> Floats:
        """Express points of the flange frame in the base frame, (n, 3) [m].

        Going back along the chain, T_i = Rot_z(theta) Trans(a, 0, d) Rot_x(alpha)
        Rot_y(beta).

        Args:
            q: Controller angles, (n, 6) [rad].
            point: Flange frame, (n, 3) [m].
            beta: Hayati's rotations of the links, (6,) [rad].
        """
        points = np.array(point, float, ndmin=2, order="C")
        return _native.placed(self.pack(beta), floats(q), points)


# The arm: forward kinematics, Jacobians, gravity torque, inverse kinematics.
#
# Angles are the controller's joint angles [rad], lengths metres, the frame the arm's
# base frame.

SPEED_UP, SPEED_UP_OF_PUSH = 0.4, 0.1  # [s] to full speed, to full acceleration
GRAVITY = 9.80665  # [m/s^2], standard gravity
FLOOR = (0.0, 0.0, -1.0)  # direction of weight in the base frame of an arm that stands
BEHIND = np.triu(np.ones((6, 6)))  # by joint, then link: 1 where the joint carries it
LEVEL = 1e-9  # [rad] a smaller tilt is the rounding of a base frame


@dataclass(frozen=True, eq=False)
class Arm:
    """A six-axis arm.

    Attributes:
        file: The validated arm file.
        name: Name of the arm.
        id: Hash of the kinematics; models are bound to it.
        dh: Nominal Denavit-Hartenberg parameters.
        lower, upper: Joint limits, (6,) [rad].
        play: Width of the play operator, (6,) [rad].
        coupling: Drive-side angles = coupling @ q, (6, 6).
        gear_ratio: Turns of every motor per turn of its joint, (6,); NaN where not
            known.
        repeatability: Pose repeatability RP of ISO 9283 [m].
        weight: Direction in which weight pulls, unit vector, (3,), base frame.
    """

    file: ArmFile
    name: str
    id: str
    dh: DH
    lower: Floats
    upper: Floats
    play: Floats
    coupling: Floats
    gear_ratio: Floats
    repeatability: float
    weight: Floats = field(default_factory=lambda: np.array(FLOOR))

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel between processes as the arm file: compiled parts cannot."""
        return _build_mounted, (self.file, self.weight)

    def mount(self, weight: Floats) -> Arm:
        """Return the arm with weight that pulls in another direction.

        Args:
            weight: The direction, (3,), base frame, of any length.
        """
        unit: Floats = weight / np.linalg.norm(weight)
        level = np.linalg.norm(unit - FLOOR) < LEVEL
        return replace(self, weight=np.array(FLOOR) if level else unit)

    @property
    def stands(self) -> bool:
        """Return True if weight pulls along -z of the base, as on a level floor."""
        return bool((self.weight == FLOOR).all())

    @property
    def pull(self) -> Floats:
        """Acceleration of gravity, (3,) [m/s^2], base frame."""
        return GRAVITY * self.weight

    @property
    def lumps(self) -> Floats:
        """Mass [kg] and first moment [kg m] of every link in its D-H frame, (6, 4)."""
        links = np.array(self._links)
        links[:, 1:] *= links[:, :1]
        return links

    @cached_property
    def velocity(self) -> Floats:
        """Limits of the joints' speeds, (6,) [rad/s].

        Raises:
            ArmError: The arm file does not tell them.
        """
        told = self.file.joints.velocity_deg_s
        if told is None:
            problem, cure = "has no speeds of the joints", "Add velocity_deg_s to plan"
            raise ArmError(self.name, problem, cure, place="$.joints")
        return np.deg2rad(told)

    @cached_property
    def acceleration(self) -> Floats:
        """Limits of the accelerations, (6,) [rad/s^2]; a guess where they are not told.

        Raises:
            ArmError: The arm file tells no speeds either.
        """
        told = self.file.joints.acceleration_deg_s2
        return self.velocity / SPEED_UP if told is None else np.deg2rad(told)

    @cached_property
    def jerk(self) -> Floats:
        """Limits of the jerks, (6,) [rad/s^3]; a guess where they are not told.

        Raises:
            ArmError: The arm file tells no speeds either.
        """
        told = self.file.joints.jerk_deg_s3
        return (
            self.acceleration / SPEED_UP_OF_PUSH if told is None else np.deg2rad(told)
        )

    @property
    def mass(self) -> float:
        """Mass of all links [kg]; 0 where not known."""
        return float(self._links[:, 0].sum())

    @cached_property
    def _links(self) -> Floats:
        """Masses [kg] and centres in the D-H frames [m], (6, 4); 0 where not known."""
        links = self.file.links
        if links is None:
            return np.zeros((6, 4))
        return np.column_stack([links.mass_kg, np.array(links.com_mm) * MM])

    @cached_property
    def _solver(self) -> Inverse:
        """The inverse kinematics: by a closed form where the arm file holds one."""
        opw, limits = self.file.opw, (self.lower, self.upper)
        if opw is None:
            return Inverse(NumericForm(self.dh.pack()), np.eye(6), *limits)
        return Inverse(ClosedForm(opw), self.dh.mix, *limits)

    def link_frames(self, q: Floats) -> Floats:
        """Place the D-H frames 0 (base) to 6 (flange): (n, 6) -> (n, 7, 4, 4)."""
        return self.dh.frames(q)

    def flange(self, q: Floats) -> Floats:
        """Place the flange: (n, 6) [rad] -> (n, 4, 4) [m], base frame."""
        return self.dh.flange(q)

    def tcp(self, q: Floats, tool: Floats) -> Floats:
        """Place the TCP alone: (n, 3) [m], base frame.

        Args:
            q: Joint angles, (n, 6) [rad].
            tool: TCP in the flange frame, (n, 3) [m].
        """
        return self.dh.place(q, tool)

    def landmarks(self, q: Floats, tool: Floats) -> Floats:
        """Place elbow, wrist centre and TCP: (n, 3, 3) [m], base frame.

        The elbow is the origin of D-H frame 2, on axis 3; the wrist centre that of
        frame 4, on axis 5.

        Args:
            q: Joint angles, (n, 6) [rad].
            tool: TCP in the flange frame, (n, 3) [m].
        """
        return _native.landmarks(self.dh.pack(), floats(q), floats(tool))

    def jacobian(self, q: Floats, tool: Floats) -> Floats:
        """Differentiate the TCP: (n, 6, 6), rows 0-2 linear [m/rad], 3-5 angular.

        Args:
            q: Joint angles, (n, 6) [rad].
            tool: TCP in the flange frame, (3,) or (n, 3) [m].
        """
        points = floats(np.broadcast_to(tool, (len(q), 3)))
        by_joint = _native.jacobian(self.dh.pack(), floats(q), points)
        return np.ascontiguousarray(np.swapaxes(by_joint, 1, 2))

    def gravity_torque(
        self,
        q: Floats,
        payload: Floats | float = 0.0,
        payload_com: Floats | float = 0.0,
    ) -> Floats:
        """Give the torque that gravity exerts about every joint, (n, 6) [N m].

        Args:
            q: Joint angles, (n, 6) [rad].
            payload: Payload mass, (n,) [kg].
            payload_com: Its centre of mass in the flange frame, (n, 3) [m].
        """
        own, carried = self.torques(q, payload, payload_com)
        return own + carried

    def torques(
        self, q: Floats, payload: Floats | float, payload_com: Floats | float
    ) -> tuple[Floats, Floats]:
        """Give the torques of the arm's own links and of the payload.

        Args:
            q: Joint angles, (n, 6) [rad].
            payload: Payload mass, (n,) [kg].
            payload_com: Its centre of mass in the flange frame, (n, 3) [m]; where there
                is no payload it need not be known.

        Returns:
            (n, 6) [N m] each.
        """
        load = np.empty((len(q), 4))
        load[:, 0], load[:, 1:] = payload, payload_com
        if not (self._links[:, 0].any() or load[:, 0].any()):
            return np.zeros((len(q), 6)), np.zeros((len(q), 6))
        if not self.stands:
            z = self.link_frames(q)[:, :6, :3, 2]
            both = self.moments(q, payload, payload_com)
            own, carried = (np.einsum("njc,njc->nj", z, moment) for moment in both)
            return self._to_controller(own), self._to_controller(carried)
        packed = self.dh.pack()
        own, carried = _native.torque(packed, floats(q), floats(self._links), load)
        return -GRAVITY * own, -GRAVITY * carried

    def _to_controller(self, per_axis: Floats) -> Floats:
        """Convert torques about the D-H axes, (n, 6, ..), to the controller's joints.

        The first index after the pose is that of the axis.
        """
        dh, last = self.dh, np.moveaxis(per_axis, 1, -1)
        turned: Floats = (last * dh.sense) @ dh.mix
        return np.moveaxis(turned, -1, 1)

    def moments(
        self, q: Floats, payload: Floats | float, payload_com: Floats | float
    ) -> tuple[Floats, Floats]:
        """Compute the moments of all weight behind every joint, of links and payload.

        Args:
            q: Joint angles, (n, 6) [rad].
            payload: Payload mass, (n,) [kg].
            payload_com: Its centre of mass in the flange frame, (n, 3) [m]; without a
                payload it may be unknown.

        Returns:
            (n, 6, 3) [N m] each, base frame: number k about the origin of D-H frame k,
            through which joint k + 1 turns, of the links k + 1 to 6.
        """
        frames, links = self.link_frames(q), self._links
        origin, mass = frames[:, :6, :3, 3], links[:, 0]
        centre = np.einsum("niab,ib->nia", frames[:, 1:, :3, :3], links[:, 1:])
        first = mass[:, None] * (centre + frames[:, 1:, :3, 3])
        behind = np.cumsum(first[:, ::-1], axis=1)[:, ::-1]
        heavy = np.cumsum(mass[::-1])[::-1]
        own = behind - heavy[:, None] * origin
        load = np.broadcast_to(payload, (len(q),))
        com = np.broadcast_to(payload_com, (len(q), 3))
        com = np.where((load > 0.0)[:, None], com, 0.0)
        held = np.einsum("nab,nb->na", frames[:, 6, :3, :3], com) + frames[:, 6, :3, 3]
        carried = load[:, None, None] * (held[:, None] - origin)
        return np.cross(own, self.pull), np.cross(carried, self.pull)

    def tilting_moment(
        self, q: Floats, payload: Floats | float, payload_com: Floats | float
    ) -> Floats:
        """Give the moment of all weight about the base's axes, (n, 3) [N m].

        Args:
            q: Joint angles, (n, 6) [rad].
            payload: Payload mass, (n,) [kg].
            payload_com: Its centre of mass in the flange frame, (n, 3) [m].

        Returns:
            About x, y and z through the base's origin; about z it is 0 on a floor.
        """
        frames, mass = self.link_frames(q)[:, 1:], self._links[:, 0]
        centre = np.einsum("niab,ib->nia", frames[..., :3, :3], self._links[:, 1:])
        place = mass @ (centre + frames[..., :3, 3])
        com = np.broadcast_to(payload_com, (len(q), 3))
        carried = np.einsum("nab,nb->na", frames[:, 5, :3, :3], com)
        place += np.multiply(payload, (carried + frames[:, 5, :3, 3]).T).T
        return np.cross(place, self.pull)

    def gravity_basis(self, q: Floats) -> Floats:
        """Give the joint torque per unit of every lumped mass parameter.

        Columns are, link by link, the mass at the D-H frame's origin [N m/kg] and the
        three first moments in that frame [N m/(kg m)].

        Returns:
            (n, 6, 24); redundant: only some combinations reach the joints.
        """
        frames = self.link_frames(q)
        axis, origin = frames[:, :6, :3, 2], frames[:, :6, :3, 3]
        lever = frames[:, None, 1:, :3, 3] - origin[:, :, None]  # joint, then link
        basis = np.empty((len(q), 6, 6, 4))
        basis[..., 0] = np.cross(axis[:, :, None], lever) @ self.pull
        basis[..., 1:] = self._by_first_moments(frames, axis[..., None])[:, :, 0]
        basis *= BEHIND[:, :, None]
        return self._to_controller(basis).reshape(len(q), 6, 24)

    def bending_basis(self, q: Floats) -> Floats:
        """Give the moment across every joint per unit of the links' first moments.

        Returns:
            (n, 6, 2, 6, 3) [N m/(kg m)]: by joint k, about x and y of D-H frame k - 1,
            which does not turn with it, per first moment of every link in its frame.
        """
        frames = self.link_frames(q)
        across = self._by_first_moments(frames, frames[:, :6, :3, :2])
        return np.asarray(across * BEHIND[:, None, :, None])

    def bending_moments(
        self, q: Floats, payload: Floats | float, payload_com: Floats | float
    ) -> Floats:
        """Compute the moment of links and payload across every joint.

        Args:
            q: Joint angles, (n, 6) [rad].
            payload: Payload mass, (n,) [kg].
            payload_com: Its centre of mass in the flange frame, (n, 3) [m].

        Returns:
            (n, 6, 2) [N m]: by joint k, about x and y of D-H frame k - 1.
        """
        own, carried = self.moments(q, payload, payload_com)
        across = self.link_frames(q)[:, :6, :3, :2]
        moment: Floats = np.einsum("njca,njc->nja", across, own + carried)
        return moment

    def _by_first_moments(self, frames: Floats, axes: Floats) -> Floats:
        """Give moments per unit of first moment of every link, (n, 6, k, 6, 3).

        Args:
            frames: (n, 7, 4, 4).
            axes: By joint, as columns, (n, 6, 3, k).
        """
        along = np.swapaxes(frames[:, 1:, :3, :3], 2, 3)  # (n, link, axis of it, 3)
        turned = np.cross(along, self.pull)
        across: Floats = np.einsum("njca,nibc->njaib", axes, turned, optimize=True)
        return across

    @property
    def solver(self) -> _native.Solver:
        """What the core solves its inverse kinematics by."""
        return self._solver.solver

    def inverse(self, flange: Floats) -> Branches:
        """Solve the inverse kinematics of flange poses (n, 4, 4) [m]."""
        return self._solver.branches(flange)

    def on_branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch of flange poses (n, 4, 4) [m], on any turn.

        Args:
            flange: Flange poses.
            slot: Slots 4 W + 2 S + E, (n,).

        Returns:
            (n, 6) [rad], NaN where the branch does not exist.
        """
        return self._solver.branch(flange, slot)

    def into_range(self, q: Floats) -> Floats:
        """Shift joint angles (.., 6) [rad] by turns into the range, as in `inverse`."""
        return self._solver.into_range(q)

    def branch(self, q: Floats) -> Ints:
        """Name the branch (slot 4 W + 2 S + E) of joint angles (n, 6) [rad]."""
        return self._solver.slot(q)

    def nearest(
        self, flange: Floats, near: Floats, branch: Ints | None = None
    ) -> Floats:
        """Solve for the joint angles nearest to given ones.

        Args:
            flange: Flange poses, (n, 4, 4) [m].
            near: Joint angles to stay close to, (n, 6) [rad].
            branch: Slot to use, (n,); default: the nearest one, in the maximum norm.
                Without a closed form, a solution that no singularity parts from
                `near` comes first.

        Returns:
            (n, 6) [rad] on the turn nearest to `near`, NaN where no solution exists.
        """
        if branch is not None:
            return self._solver.nearest(flange, near, branch)
        slots = self.inverse(flange).q
        slots = near[:, None, :] + wrap(slots - near[:, None, :])
        gap = np.abs(slots - near[:, None, :]).max(-1)
        best = np.argmin(np.where(np.isnan(gap), np.inf, gap), axis=1)
        q: Floats = slots[np.arange(len(slots)), best]
        return q

    def within_limits(self, q: Floats) -> NDArray[np.bool_]:
        """Tell which joint angles (n, 6) [rad] respect the limits, (n,)."""
        return np.asarray(((q >= self.lower) & (q <= self.upper)).all(axis=-1))


def load_arm(name: str | Path, beside: Path | None = None) -> Arm:
    """Load a shipped arm by name, or an arm file by path.

    Raises:
        ArmError: Naming the file, the place and the cure.
    """
    path = arm_path(str(name), beside)
    arm = build_arm(read_arm_file(path))
    if arm.file.opw is not None:
        _check_inverse(arm, path)
    return arm


def arm_of_text(path: Path, text: str) -> Arm:
    """Build the arm of an arm file that is not written yet.

    Args:
        path: What messages name.
        text: Of the arm file.

    Raises:
        ArmError: It is no arm file.
    """
    return build_arm(parse_toml(path, text.encode(), ArmFile, ArmError))


def check_flanges(arm: Arm, path: Path, q: Floats, wanted: Floats) -> None:
    """Refuse an arm that is not what the file says from which it was made.

    Args:
        arm: The arm.
        path: That file.
        q: Joint angles, (n, 6) [rad].
        wanted: Its flanges there, (n, 4, 4) [m].

    Raises:
        ArmError: The arm places the flange elsewhere.
    """
    gap = float(np.abs(arm.flange(q) - wanted).max())
    back = arm.flange(arm.nearest(wanted, q))
    if arm.file.opw is None:  # Newton's method may miss a pose
        back = np.where(np.isnan(back), wanted, back)
    gap = max(gap, float(np.abs(back - wanted).max()))
    if not gap < 1e-9:
        problem = f"cannot be written as an arm file: flanges differ by {gap:.3g}"
        raise ArmError(path, problem, "Write the arm file by hand")


def _build_mounted(file: ArmFile, weight: Floats) -> Arm:
    """Build an arm with weight that pulls in a direction, (3,)."""
    return build_arm(file).mount(weight)


def build_arm(file: ArmFile) -> Arm:
    """Convert an arm file to SI."""
    dh, joints = file.dh, file.joints
    mix = np.eye(6)
    mix[2, 1] = dh.axis2_share
    sense = np.array(dh.sense)
    offset = np.deg2rad(dh.offset_deg) + sense * np.deg2rad(dh.shift_deg)
    a, d = np.array(dh.a_mm) * MM, np.array(dh.d_mm) * MM
    alpha = np.deg2rad(dh.alpha_deg)
    # A model fitted while the flag added axis 2 to every arm is of another chain.
    kinematics = dh.model_dump_json() + ("-axis2" if dh.axis2_share < 0 else "")
    digest = hashlib.sha256(kinematics.encode()).hexdigest()[:16]
    ratio = np.array(joints.gear_ratio or [0.0] * 6)
    coupling = joints.drive_coupling
    return Arm(
        file=file,
        name=file.name,
        id=digest,
        dh=DH(a, d, alpha, offset, sense, mix),
        lower=np.deg2rad(joints.lower_deg),
        upper=np.deg2rad(joints.upper_deg),
        play=np.deg2rad(joints.play_deg),
        coupling=np.eye(6) if coupling is None else np.array(coupling),
        gear_ratio=np.where(ratio == 0.0, np.nan, ratio),
        repeatability=file.repeatability_mm * MM,
    )


# [deg] At one of these an elbow may be stretched: there nothing tells.
_PROBED = [
    [20.0, 10.0, -100.0, 40.0, 50.0, -60.0], [0.0, 0.0, -90.0, 0.0, 30.0, 0.0],
    [-30.0, 20.0, -60.0, 10.0, -40.0, 90.0], [10.0, -20.0, -130.0, -70.0, 60.0, 20.0],
]  # fmt: skip


def _check_inverse(arm: Arm, path: Path) -> None:
    """Refuse an arm file whose two kinematics disagree."""
    wanted = arm.flange(np.deg2rad(_PROBED))
    solved = arm.inverse(wanted).q.reshape(-1, 6)
    again = arm.flange(solved).reshape(len(wanted), 8, 4, 4)
    gap = np.abs(again - wanted[:, None]).max((2, 3))
    if (gap <= 1e-8).any(1).sum() < len(_PROBED) - 1:
        raise ArmError(
            path,
            "the closed-form parameters do not describe the arm of [dh]",
            "Correct [opw] or [dh]",
            place="$.opw",
        )
