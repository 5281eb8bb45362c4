"""Arms as Pinocchio sees them. The only importer of pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from postproc.arrays import Floats
from postproc.robot.arm_file import ArmFile
from postproc.verify.opinion import ArmFacts

GRAVITY = 9.80665  # [m/s^2], standard gravity
CLOSE = 1e-10  # [m] and [rad] to the pose that Newton's method goes to
ROUNDS = 12  # of it: one is enough between samples of a path


class PinocchioArm:
    """Frames, Jacobians and gravity torques of one arm with one load.

    The angles of its joints are the controller's, but for the share of axis 2 that a
    parallelogram keeps out of axis 3 (`mix`).
    """

    def __init__(self, model: Any, pin: Any, mix: Floats) -> None:
        """Take a model of which the last frame is the flange."""
        self._pin, self._model, self._data = pin, model, model.createData()
        self._flange, self._mix = model.nframes - 1, mix

    @classmethod
    def build(cls, facts: ArmFacts, load: Floats | None = None) -> Self:
        """Build the chain from the D-H parameters of an arm file.

        Args:
            facts: The arm.
            load: Mass [kg] and centre in the flange frame [m], (4,).
        """
        import pinocchio as pin

        model, here = pin.Model(), pin.SE3.Identity()
        model.gravity.linear = GRAVITY * facts.weight
        for k in range(6):
            joint, link = _add_joint(pin, model, facts.file, k, here)
            here = link
        if load is not None and load[0] > 0:
            weight = pin.Inertia(float(load[0]), load[1:], np.zeros((3, 3)))
            model.appendBodyToJoint(joint, weight, here)
        model.addFrame(pin.Frame("flange", joint, 0, here, pin.FrameType.OP_FRAME))
        return cls(model, pin, _mix(facts.file))

    def flange(self, q: Floats) -> Floats:
        """Place the flange for joint angles (6,) [rad]: (4, 4) [m]."""
        self._pin.framesForwardKinematics(self._model, self._data, self._mix @ q)
        return np.array(self._data.oMf[self._flange].homogeneous)

    def place(self, q: Floats) -> tuple[Floats, Floats, Floats]:
        """Place the arm for joint angles (6,) [rad].

        Returns:
            The flange, (4, 4) [m], the origins of the joints, (6, 3) [m], and how the
            base's origin would move with the flange, (6, 6), linear rows first.
        """
        pin, data = self._pin, self._data
        J = pin.computeJointJacobians(self._model, data, self._mix @ q)
        flange = pin.updateFramePlacement(self._model, data, self._flange).homogeneous
        origins = [frame.translation for frame in list(data.oMi)[1:]]
        return np.array(flange), np.array(origins), np.array(J)

    @property
    def mix(self) -> Floats:
        """Angles of the chain from the controller's, (6, 6)."""
        return self._mix

    def jacobian(self, q: Floats) -> Floats:
        """Differentiate the flange: (6, 6), linear rows first, base frame."""
        pin = self._pin
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        geometric = self._mix @ q
        J = pin.computeFrameJacobian(
            self._model, self._data, geometric, self._flange, world
        )
        return np.asarray(J @ self._mix)

    def torque(self, q: Floats) -> Floats:
        """Return the torque that gravity exerts about every joint, (6,) [N m]."""
        held = self._pin.computeGeneralizedGravity(
            self._model, self._data, self._mix @ q
        )
        return np.asarray(-self._mix.T @ held)

    def turn(self, start: Floats, end: Floats) -> Floats:
        """Return the rotation vector from one rotation to another, base frame."""
        return np.asarray(self._pin.log3(end[:3, :3] @ start[:3, :3].T))

    def between(self, start: Floats, end: Floats, u: float) -> Floats:
        """Turn from one rotation (3, 3) to another about one axis, by a share u."""
        return np.asarray(self._pin.exp3(u * self.turn(start, end)) @ start[:3, :3])

    def reach(self, flange: Floats, near: Floats) -> Floats | None:
        """Go to a flange pose (4, 4) by Jacobian steps, None where they do not lead."""
        q = np.array(near)
        for _ in range(ROUNDS):
            here = self.flange(q)
            off = np.append(flange[:3, 3] - here[:3, 3], self.turn(here, flange))
            if np.abs(off).max() < CLOSE:
                return q
            try:
                step = np.linalg.solve(self.jacobian(q), off)
            except np.linalg.LinAlgError:
                return None
            if np.abs(step).max() > 0.5:  # [rad]: it leaves the branch
                return None
            q = q + step
        return None


def _add_joint(
    pin: Any, model: Any, file: ArmFile, k: int, before: Any
) -> tuple[int, Any]:
    """Add joint k behind the D-H frame before it; return its number and its frame."""
    dh = file.dh
    zero = np.deg2rad(dh.offset_deg[k] + dh.sense[k] * dh.shift_deg[k])
    placed = before * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, zero), np.zeros(3))
    about = pin.JointModelRevoluteUnaligned(np.array([0.0, 0.0, float(dh.sense[k])]))
    joint = model.addJoint(k, about, placed, f"joint{k + 1}")
    tilt = pin.rpy.rpyToMatrix(np.deg2rad(dh.alpha_deg[k]), 0.0, 0.0)
    link = pin.SE3(tilt, np.array([dh.a_mm[k], 0.0, dh.d_mm[k]]) / 1e3)
    if file.links is not None:
        centre = np.array(file.links.com_mm[k]) / 1e3
        mass = pin.Inertia(file.links.mass_kg[k], centre, np.zeros((3, 3)))
        model.appendBodyToJoint(joint, mass, link)
    return joint, link


def serial(file: ArmFile) -> Floats:
    """Return the controller's angles from those of joints in series, (6, 6)."""
    return np.asarray(np.linalg.inv(_mix(file)))


def _mix(file: ArmFile) -> Floats:
    """Return the angles of the chain from the controller's, (6, 6).

    A parallelogram keeps the forearm's direction while axis 2 turns alone: the two
    turns are about parallel axes, the same way or the other, and cancel.
    """
    dh, mix = file.dh, np.eye(6)
    if dh.axis3_adds_axis2:
        same = dh.sense[1] * dh.sense[2] * np.cos(np.deg2rad(dh.alpha_deg[1]))
        mix[2, 1] = -np.sign(same)
    return mix


class PinocchioUrdf:
    """Six joints of a URDF between two of its links, as Pinocchio reads the file.

    All other joints stand at 0, as an arm file takes them.
    """

    def __init__(self, text: str, joints: Sequence[str], base: str, tip: str) -> None:
        """Read a URDF.

        Args:
            text: Of the file.
            joints: Names of the six joints, base to tip.
            base: The link at the begin.
            tip: The link at the end.
        """
        import pinocchio as pin

        whole = pin.buildModelFromXML(text)
        zero = pin.neutral(whole)
        others = [k for k in range(1, whole.njoints) if whole.names[k] not in joints]
        self._pin = pin
        self._model = pin.buildReducedModel(whole, others, zero)
        self._data, self._zero = self._model.createData(), pin.neutral(self._model)
        body = pin.FrameType.BODY
        self._ends = tuple(self._model.getFrameId(name, body) for name in (base, tip))
        self._pin.framesForwardKinematics(self._model, self._data, self._zero)
        down = self._data.oMf[self._ends[0]].rotation[:, 2]
        self._model.gravity.linear = -GRAVITY * down

    def flange(self, q: Floats) -> Floats:
        """Place the tip in the base link for joint angles (6,) [rad], (4, 4) [m]."""
        pin, angles = self._pin, self._angles(q)
        pin.framesForwardKinematics(self._model, self._data, angles)
        base, tip = (self._data.oMf[k] for k in self._ends)
        return np.array((base.inverse() * tip).homogeneous)

    def torque(self, q: Floats) -> Floats:
        """Return the torque that gravity exerts about every joint, (6,) [N m]."""
        angles = self._angles(q)
        held = self._pin.computeGeneralizedGravity(self._model, self._data, angles)
        return np.asarray(-held)

    def _angles(self, q: Floats) -> Any:
        """Return what Pinocchio calls the angles: of endless joints sine and cosine."""
        return self._pin.integrate(self._model, self._zero, q)

    @property
    def limits(self) -> Floats:
        """Lower and upper limits and velocities, (3, 6); NaN for endless joints."""
        low, high = np.full(6, np.nan), np.full(6, np.nan)
        for k, joint in enumerate(list(self._model.joints)[1:]):
            if joint.nq == 1:
                low[k] = self._model.lowerPositionLimit[joint.idx_q]
                high[k] = self._model.upperPositionLimit[joint.idx_q]
        return np.array([low, high, self._model.velocityLimit])

    @property
    def mass(self) -> Floats:
        """What hangs on every joint, (6,) [kg]."""
        return np.array([inertia.mass for inertia in list(self._model.inertias)[1:]])

    @property
    def reach(self) -> float:
        """Length of all links, stretched [m]."""
        return float(sum(np.linalg.norm(place.translation) for place in self._places()))

    def measure_turn(self, other: PinocchioUrdf) -> float:
        """Return by what angle the frames of joints stand otherwise, in all [rad]."""
        pairs = zip(self._places(), other._places(), strict=True)
        return float(sum(
            np.linalg.norm(self._pin.log3(a.rotation.T @ b.rotation)) for a, b in pairs
        ))  # fmt: skip

    def _places(self) -> list[Any]:
        """Place every joint on the one before it, and both ends."""
        ends = [self._model.frames[k].placement for k in self._ends]
        return [*list(self._model.jointPlacements)[1:], *ends]
