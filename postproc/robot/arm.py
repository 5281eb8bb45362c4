"""The arm: forward kinematics, Jacobians, gravity torque, inverse kinematics."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc import _native
from postproc.arrays import Floats, Ints, floats
from postproc.exceptions import ArmError, PlanError
from postproc.robot.arm_file import ArmFile, arm_path, read_arm_file
from postproc.robot.inverse import Branches, Inverse, wrap
from postproc.robot.pose import MM

# The Denavit-Hartenberg chain: frames and points along it, for many poses at once.

Frame = tuple[
    Floats, Floats, Floats, Floats
]  # axes x, y, z and origin [m], (3, n) each


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

    def packed(self, beta: Floats | None = None) -> Floats:
        """Return what the core knows of the chain, (12, 6).

        Args:
            beta: Hayati's rotations of the links, (6,) [rad].
        """
        beta = np.zeros(6) if beta is None else beta
        rows = self.a, self.d, self.alpha, self.offset, self.sense, beta, *self.mix.T
        return np.array(rows)

    def frames(self, q: Floats) -> Iterator[Frame]:
        """Walk along the link frames 0 (base) to 6 (flange) for angles (n, 6) [rad].

        Every frame is the one before, turned and shifted along its z, then its new x.
        """
        theta = np.ascontiguousarray(self.angles(q).T)
        cos, sin = np.cos(theta), np.sin(theta)
        shape = (3, len(q))
        x, y, z = (np.broadcast_to(axis[:, None], shape) for axis in np.eye(3))
        p: Floats = np.zeros(shape)
        yield x, y, z, p
        for i in range(6):
            ca, sa = np.cos(self.alpha[i]), np.sin(self.alpha[i])
            p = p + self.d[i] * z
            x, across = cos[i] * x + sin[i] * y, cos[i] * y - sin[i] * x
            y, z = ca * across + sa * z, ca * z - sa * across
            p = p + self.a[i] * x
            yield x, y, z, p

    def flange(self, q: Floats) -> Floats:
        """Place the flange for angles (n, 6) [rad]: (n, 4, 4) [m]."""
        return _native.flange(self.packed(), floats(q))

    def placed(self, q: Floats, point: Floats, beta: Floats | None = None) -> Floats:
        """Express points of the flange frame in the base frame, (n, 3) [m].

        Going back along the chain, T_i = Rot_z(theta) Trans(a, 0, d) Rot_x(alpha)
        Rot_y(beta).

        Args:
            q: Controller angles, (n, 6) [rad].
            point: Flange frame, (n, 3) [m].
            beta: Hayati's rotations of the links, (6,) [rad].
        """
        points = np.array(point, float, ndmin=2, order="C")
        return _native.placed(self.packed(beta), floats(q), points)


def pose_of(frame: Frame) -> Floats:
    """Write frames as poses, (n, 4, 4) [m]."""
    pose = np.zeros((frame[3].shape[1], 4, 4))
    for column, values in enumerate(frame):
        pose[:, :3, column] = values.T
    pose[:, 3, 3] = 1.0
    return pose


# The arm: forward kinematics, Jacobians, gravity torque, inverse kinematics.
#
# Pinocchio does the torque; no other module imports it. Angles are the
# controller's joint angles [rad], lengths metres, the frame the arm's base frame.

GRAVITY = 9.80665  # [m/s^2], standard gravity


@dataclass(frozen=True, eq=False)
class Arm:
    """A six-axis arm.

    Attributes:
        file: The validated arm file.
        name: Name of the arm.
        id: Hash of the kinematics; models are bound to it.
        dh: Nominal Denavit-Hartenberg parameters.
        lower, upper: Joint limits, (6,) [rad].
        velocity, acceleration, jerk: Limits, (6,) [rad/s], [rad/s^2], [rad/s^3].
        play: Width of the play operator, (6,) [rad].
        coupling: Drive-side angles = coupling @ q, (6, 6).
        gear_ratio: (6,), NaN where unknown.
        repeatability: Pose repeatability RP of ISO 9283 [m].
    """

    file: ArmFile
    name: str
    id: str
    dh: DH
    lower: Floats
    upper: Floats
    velocity: Floats
    acceleration: Floats
    jerk: Floats
    play: Floats
    coupling: Floats
    gear_ratio: Floats
    repeatability: float

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel between processes as the arm file: compiled parts cannot."""
        return _build, (self.file,)

    @cached_property
    def _chain(self) -> Any:
        """Build the pinocchio model: joint i turns about z of D-H frame i - 1."""
        import pinocchio as pin  # slow to load, and for loads alone

        model, parent, placement = pin.Model(), 0, pin.SE3.Identity()
        model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        for i in range(6):
            joint = pin.JointModelRZ()
            parent = model.addJoint(parent, joint, placement, f"joint {i + 1}")
            placement = pin.SE3(
                pin.utils.rotate("x", float(self.dh.alpha[i])),
                np.array([self.dh.a[i], 0.0, self.dh.d[i]]),
            )
            if self.file.links is not None:
                com = placement.act(np.array(self.file.links.com_mm[i]) * MM)
                inertia = pin.Inertia(self.file.links.mass_kg[i], com, np.eye(3))
                model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        return model

    @cached_property
    def _inverse(self) -> Inverse | None:
        """Build the closed-form inverse kinematics, or None where there is none."""
        opw = self.file.opw
        limits = (self.lower, self.upper)
        return None if opw is None else Inverse(opw, self.dh.mix, *limits)

    @property
    def has_inverse(self) -> bool:
        """Tell whether the arm file holds a closed-form inverse."""
        return self.file.opw is not None

    def link_frames(self, q: Floats) -> Floats:
        """Place the D-H frames 0 (base) to 6 (flange): (n, 6) -> (n, 7, 4, 4)."""
        return np.stack([pose_of(frame) for frame in self.dh.frames(q)], axis=1)

    def flange(self, q: Floats) -> Floats:
        """Place the flange: (n, 6) [rad] -> (n, 4, 4) [m], base frame."""
        return self.dh.flange(q)

    def tcp(self, q: Floats, tool: Floats) -> Floats:
        """Place the TCP alone: (n, 3) [m], base frame.

        Args:
            q: Joint angles, (n, 6) [rad].
            tool: TCP in the flange frame, (n, 3) [m].
        """
        return self.dh.placed(q, tool)

    def landmarks(self, q: Floats, tool: Floats) -> Floats:
        """Place elbow, wrist centre and TCP: (n, 3, 3) [m], base frame.

        The elbow is the origin of D-H frame 2, on axis 3; the wrist centre that of
        frame 4, on axis 5.

        Args:
            q: Joint angles, (n, 6) [rad].
            tool: TCP in the flange frame, (n, 3) [m].
        """
        points = [frame[3].T for frame in islice(self.dh.frames(q), 5)]
        return np.stack([points[2], points[4], self.tcp(q, tool)], axis=1)

    def kinematics(self, q: Floats) -> tuple[Floats, Floats]:
        """Place the flange and give the joint screws.

        Args:
            q: Joint angles, (n, 6) [rad].

        Returns:
            Flange poses (n, 4, 4) and the Jacobian (n, 6, 6) of the body point that
            lies in the base origin: rows 0-2 its velocity, rows 3-5 the angular
            velocity, per unit of controller joint velocity.
        """
        *joints, last = self.dh.frames(q)
        screws = np.empty((len(q), 6, 6))
        for i, (_, _, axis, point) in enumerate(joints):
            screws[:, :3, i] = np.cross(point, axis, axis=0).T
            screws[:, 3:, i] = axis.T
        return pose_of(last), (screws * self.dh.sense) @ self.dh.mix

    def joint_axes(self, q: Floats) -> tuple[Floats, Floats]:
        """Give every joint's rotation axis and a point on it.

        Returns:
            Unit axes of positive controller rotation (n, 6, 3), points (n, 6, 3) [m].
        """
        screws = np.swapaxes(self.kinematics(q)[1], 1, 2)
        axes = screws[..., 3:]
        return axes, np.cross(axes, screws[..., :3])

    def jacobian(self, q: Floats, tool: Floats) -> Floats:
        """Differentiate the TCP: (n, 6, 6), rows 0-2 linear [m/rad], 3-5 angular.

        Args:
            q: Joint angles, (n, 6) [rad].
            tool: TCP in the flange frame, (3,) or (n, 3) [m].
        """
        flange, J = self.kinematics(q)
        tool = np.broadcast_to(tool, (len(q), 3))
        tcp = flange[:, :3, 3] + np.einsum("nij,nj->ni", flange[:, :3, :3], tool)
        J[:, :3] += np.cross(J[:, 3:], tcp[:, :, None], axis=1)
        return J

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
        n = len(q)
        own = np.zeros((n, 6))
        if self.file.links is not None and n:
            import pinocchio as pin

            pool = pin.ModelPool(self._chain, 1)
            theta = np.asfortranarray(self.dh.angles(q).T)
            rest = np.zeros((6, n), order="F")
            holding = pin.rneaInParallel(1, pool, theta, rest, rest).T
            own = -(holding * self.dh.sense) @ self.dh.mix
        return own + self.payload_torque(q, payload, payload_com)

    def payload_torque(
        self, q: Floats, payload: Floats | float, payload_com: Floats | float
    ) -> Floats:
        """Give the torque of the payload alone, (n, 6) [N m]; see `gravity_torque`."""
        n = len(q)
        if not np.any(payload):
            return np.zeros((n, 6))
        J = self.jacobian(q, np.broadcast_to(payload_com, (n, 3)))
        weight = -GRAVITY * np.broadcast_to(payload, (n,))
        torque: Floats = weight[:, None] * J[:, 2]
        return torque

    def gravity_basis(self, q: Floats) -> Floats:
        """Give the joint torque per unit of every lumped mass parameter.

        Columns are, link by link, the mass at the D-H frame's origin [N m/kg] and the
        three first moments in that frame [N m/(kg m)].

        Returns:
            (n, 6, 24); redundant: only some combinations reach the joints.
        """
        frames = self.link_frames(q)
        axes, points = self.joint_axes(q)
        basis = np.zeros((len(q), 6, 6, 4))
        for link in range(6):
            moved = np.arange(6) <= link
            arm = frames[:, link + 1, None, :3, 3] - points
            basis[:, :, link, 0] = np.where(moved, np.cross(axes, arm)[..., 2], 0.0)
            for k in range(3):
                lever = frames[:, link + 1, None, :3, k]
                turn = np.cross(axes, lever)[..., 2]
                basis[:, :, link, 1 + k] = np.where(moved, turn, 0.0)
        flat: Floats = -GRAVITY * basis.reshape(len(q), 6, 24)
        return flat

    @property
    def _solver(self) -> Inverse:
        """The closed-form inverse kinematics.

        Raises:
            PlanError: The arm file has none.
        """
        if self._inverse is None:
            raise PlanError(f"arm {self.name} has no closed-form inverse kinematics")
        return self._inverse

    def inverse(self, flange: Floats) -> Branches:
        """Solve the inverse kinematics of flange poses (n, 4, 4) [m].

        Raises:
            PlanError: The arm file has no closed-form inverse kinematics.
        """
        return self._solver.branches(flange)

    def on_branch(self, flange: Floats, slot: Ints) -> Floats:
        """Solve for one branch of flange poses (n, 4, 4) [m], on any turn.

        Args:
            flange: Flange poses.
            slot: Slots 4 W + 2 S + E, (n,).

        Returns:
            (n, 6) [rad], NaN where the branch does not exist.

        Raises:
            PlanError: The arm file has no closed-form inverse kinematics.
        """
        return self._solver.branch(flange, slot)

    def into_range(self, q: Floats) -> Floats:
        """Shift joint angles (.., 6) [rad] by turns into the range, as `inverse` does.

        Raises:
            PlanError: The arm file has no closed-form inverse kinematics.
        """
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

        Returns:
            (n, 6) [rad] on the turn nearest to `near`, NaN where no solution exists.
        """
        if branch is not None:
            one: Floats = near + wrap(self.on_branch(flange, branch) - near)
            return one
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
    arm = _build(read_arm_file(path))
    if arm.has_inverse:
        _check_inverse(arm, path)
    return arm


def _build(file: ArmFile) -> Arm:
    """Convert an arm file to SI."""
    dh, joints = file.dh, file.joints
    mix = np.eye(6)
    mix[2, 1] = 1.0 if dh.axis3_adds_axis2 else 0.0
    sense = np.array(dh.sense)
    offset = np.deg2rad(dh.offset_deg) + sense * np.deg2rad(dh.shift_deg)
    a, d = np.array(dh.a_mm) * MM, np.array(dh.d_mm) * MM
    alpha = np.deg2rad(dh.alpha_deg)
    digest = hashlib.sha256(dh.model_dump_json().encode()).hexdigest()[:16]
    ratio, coupling = joints.gear_ratio, joints.drive_coupling
    return Arm(
        file=file,
        name=file.name,
        id=digest,
        dh=DH(a, d, alpha, offset, sense, mix),
        lower=np.deg2rad(joints.lower_deg),
        upper=np.deg2rad(joints.upper_deg),
        velocity=np.deg2rad(joints.velocity_deg_s),
        acceleration=np.deg2rad(joints.acceleration_deg_s2),
        jerk=np.deg2rad(joints.jerk_deg_s3),
        play=np.deg2rad(joints.play_deg),
        coupling=np.eye(6) if coupling is None else np.array(coupling),
        gear_ratio=np.full(6, np.nan) if ratio is None else np.array(ratio),
        repeatability=file.repeatability_mm * MM,
    )


def _check_inverse(arm: Arm, path: Path) -> None:
    """Refuse an arm file whose two kinematics disagree.

    Raises:
        ArmError: The closed-form inverse does not lead back to the pose.
    """
    q = np.deg2rad(np.array([[20.0, 10, -100, 40, 50, -60], [0, 0, -90, 0, 30, 0]]))
    wanted = arm.flange(q)
    solved = arm.inverse(wanted).q.reshape(-1, 6)
    again = arm.flange(np.nan_to_num(solved)).reshape(2, 8, 4, 4)
    gap = np.abs(again - wanted[:, None]).max((2, 3))
    if np.isnan(solved).any(1).reshape(2, 8).all(1).any() or gap.min(1).max() > 1e-8:
        raise ArmError(
            path,
            "the closed-form parameters do not describe the arm of [dh]",
            "Correct [opw] or [dh]",
            place="$.opw",
        )
