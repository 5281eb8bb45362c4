"""The virtual arm's own chain, rotations, inverse and weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from postproc.arrays import Floats, Ints
from postproc.exceptions import PlanError

# The virtual arm's own Denavit-Hartenberg chain and the numbers of its nominal arm.


@dataclass(frozen=True)
class Chain:
    """A serial arm with six turning joints in standard D-H form.

    Joint i turns about z of frame i-1 by the D-H angle
    ``offset + sense * (q + shift)``, q being the angle the controller shows; then
    d along z, a along the new x, alpha about it, and at last beta about the new y
    (the fifth number that two nearly parallel axes need).

    Attributes:
        a, d: Lengths, (6,) or (n, 6) [m].
        alpha, offset, shift, beta: Angles, (6,) [rad].
        sense: +1 or -1, (6,).
        mass: Link masses, (6,) [kg].
        centre: Centres of mass in the D-H link frames, (6, 3) [m].
        speed: Highest joint speeds, (6,) [rad/s].
        lower, upper: Joint range, (6,) [rad].
        parallelogram: A rod holds the forearm's direction while joint 2 moves alone:
            what axis 2 turns by, joint 3 turns back.
    """

    a: Floats
    d: Floats
    alpha: Floats
    offset: Floats
    sense: Floats
    shift: Floats
    beta: Floats
    mass: Floats
    centre: Floats
    speed: Floats
    lower: Floats
    upper: Floats
    parallelogram: bool = False

    @property
    def _rod_angle(self) -> float:
        """D-H angle of joint 3 that the rod takes back per radian of joint 2."""
        facing = 1.0 if np.cos(self.alpha[1]) > 0 else -1.0
        return float(facing * self.sense[1]) if self.parallelogram else 0.0

    def dh_angles(self, q: Floats) -> Floats:
        """Convert controller angles (n, 6) to D-H angles (n, 6) [rad]."""
        theta = np.asarray(self.offset + self.sense * (q + self.shift))
        if self.parallelogram:
            theta[:, 2] -= self._rod_angle * q[:, 1]
        return theta

    def controller_angles(self, theta: Floats) -> Floats:
        """Convert D-H angles (n, 6) to controller angles (n, 6) [rad]."""
        q = np.asarray((theta - self.offset) / self.sense - self.shift)
        if self.parallelogram:
            q[:, 2] += self._rod_angle * q[:, 1] / self.sense[2]
        return q

    def by_joints(self, by_angles: Floats) -> Floats:
        """Convert derivatives by D-H angles to those by controller angles.

        Args:
            by_angles: Of the first k >= 3 angles, (n, k, ..).
        """
        senses = self.sense[: by_angles.shape[1]]
        out = np.asarray(np.moveaxis(by_angles, 1, -1) * senses)
        if self.parallelogram:
            out[..., 1] -= self._rod_angle * by_angles[:, 2]
        return np.moveaxis(out, -1, 1)

    @cached_property
    def twists(self) -> Floats:
        """Return Rx(alpha) Ry(beta) of every link, (6, 3, 3)."""
        ca, sa = np.cos(self.alpha), np.sin(self.alpha)
        cb, sb = np.cos(self.beta), np.sin(self.beta)
        zero = np.zeros(6)
        rows = [[cb, zero, sb], [sa * sb, ca, -sa * cb], [-ca * sb, sa, ca * cb]]
        return np.moveaxis(np.array(rows), -1, 0)

    def links(self, q: Floats) -> Floats:
        """Return Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), (n, 6, 4, 4).

        Args:
            q: Controller joint angles, (n, 6) [rad].
        """
        theta = self.dh_angles(q)
        turn, out = np.zeros((*theta.shape, 3, 3)), np.zeros((*theta.shape, 4, 4))
        ct, st = np.cos(theta), np.sin(theta)
        turn[..., 0, 0] = turn[..., 1, 1] = ct
        turn[..., 0, 1], turn[..., 1, 0], turn[..., 2, 2] = -st, st, 1.0
        out[..., :3, :3] = turn @ self.twists
        out[..., 0, 3], out[..., 1, 3] = self.a * ct, self.a * st
        out[..., 2, 3], out[..., 3, 3] = self.d, 1.0
        return out

    def frames(self, q: Floats) -> Floats:
        """Return all frames (n, 7, 4, 4), arm base to flange, in the arm base.

        Args:
            q: Controller joint angles, (n, 6) [rad].
        """
        links = self.links(np.asarray(q, dtype=float))
        out = np.empty((len(links), 7, 4, 4))
        out[:, 0] = np.eye(4)
        for i in range(6):
            np.matmul(out[:, i], links[:, i], out=out[:, i + 1])
        return out

    def flange(self, q: Floats, twists: Floats | None = None) -> Floats:
        """Return the flange poses (n, 4, 4) in the arm base [m].

        Args:
            q: Controller joint angles, (n, 6) [rad].
            twists: By what all behind the frame before every joint moves, in that
                frame, (n, 6, 6) [m, rad].
        """
        if twists is None:
            return np.asarray(self.frames(q)[:, 6])
        links = self.links(np.asarray(q, dtype=float))
        moved = small_motion(twists)
        placed = np.broadcast_to(np.eye(4), (len(links), 4, 4))
        for i in range(6):
            placed = placed @ moved[:, i] @ links[:, i]
        return placed

    def grow(self, growth: Floats) -> Chain:
        """Return a chain whose lengths grew by the relative amounts (n, 6)."""
        return replace(self, a=self.a * (1 + growth), d=self.d * (1 + growth))


def _nj220() -> Chain:
    degrees = np.radians
    return Chain(
        a=np.array([400.0, 1175.0, 250.0, 0.0, 0.0, 0.0]) * 1e-3,
        d=np.array([830.0, 0.0, 0.0, 1125.3, 0.0, 230.0]) * 1e-3,
        alpha=degrees([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]),
        offset=degrees([0.0, -90.0, 0.0, 0.0, 0.0, 180.0]),
        sense=np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0]),
        shift=degrees([0.0, 0.0, 90.0, 0.0, 0.0, 0.0]),
        beta=np.zeros(6),
        mass=np.array([420.0, 120.0, 304.0, 91.0, 51.0, 5.0]),
        centre=np.array([
            [-86.0, 121.0, 25.0], [-661.0, 18.0, -3.0], [-40.0, -19.0, -42.0],
            [0.0, -308.0, -26.0], [0.0, -15.0, 94.0], [0.0, -1.0, -16.0],
        ]) * 1e-3,
        speed=degrees([100.0, 90.0, 110.0, 130.0, 130.0, 195.0]),
        lower=degrees([-180.0, -75.0, -256.0, -2700.0, -125.0, -2700.0]),
        upper=degrees([180.0, 95.0, 10.0, 2700.0, 125.0, 2700.0]),
    )  # fmt: skip


NJ220 = _nj220()

# Closed-form inverse kinematics of an ortho-parallel arm with a spherical wrist.
#
# Geometry: the wrist centre gives axes 1 to 3 (a turning plane with two links in it),
# what is left of the orientation gives axes 4 to 6 (Z, Y, Z angles).

RIGHT = np.radians([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0])
NOT_RIGHT = 1e-5  # [rad]
WRIST, SHOULDER, ELBOW = 4, 2, 1  # weights of the flags in a branch number


def require_closed_form(chain: Chain) -> None:
    """Check that the chain has the shape this solution is for.

    Raises:
        PlanError: The arm is no ortho-parallel arm with a spherical wrist.
    """
    zeros = np.concatenate([chain.d[[1, 2, 4]], chain.a[3:], chain.beta])
    bent = np.abs(chain.alpha - RIGHT).max() > NOT_RIGHT
    if bent or np.abs(zeros).max() > 1e-9:
        raise PlanError(
            "the virtual arm solves Cartesian targets only for arms with a parallel "
            "second and third axis and a spherical wrist; give it joint targets"
        )


def solve_branch(chain: Chain, flange: Floats, branch: int) -> Floats:
    """Return the joint angles that put the flange at the given poses, in one branch.

    Args:
        chain: Nominal arm.
        flange: Poses in the arm base, (n, 4, 4) [m].
        branch: 4 (axis 5 negative) + 2 (wrist centre behind axis 1) + 1 (elbow
            over the other side).

    Returns:
        Controller angles (n, 6) [rad], each D-H angle in (-pi, pi]; NaN where the
        pose is out of reach.
    """
    a, d = chain.a, chain.d
    wrist = flange[:, :3, 3] - d[5] * flange[:, :3, 2]
    behind = bool(branch & SHOULDER)
    radius = np.hypot(wrist[:, 0], wrist[:, 1]) * (-1.0 if behind else 1.0)
    theta = np.empty((len(flange), 6))
    theta[:, 0] = np.arctan2(wrist[:, 1], wrist[:, 0]) + (np.pi if behind else 0.0)
    forward, down = radius - a[0], d[0] - wrist[:, 2]
    fore = np.hypot(a[2], d[3])
    cosine = (forward**2 + down**2 - a[1] ** 2 - fore**2) / (2 * a[1] * fore)
    cosine = np.where(np.abs(cosine) <= 1.0, cosine, np.nan)
    bend = np.arccos(cosine) * (-1.0 if branch & ELBOW else 1.0)
    theta[:, 1] = np.arctan2(down, forward) - np.arctan2(
        fore * np.sin(bend), a[1] + fore * np.cos(bend)
    )
    theta[:, 2] = bend - np.arctan2(d[3], a[2])
    theta[:, 3:] = _wrist_angles(theta[:, :3], flange, bool(branch & WRIST))
    theta = np.pi - np.mod(np.pi - theta, 2 * np.pi)
    theta[np.isnan(cosine)] = np.nan
    return chain.controller_angles(theta)


def _wrist_angles(theta: Floats, flange: Floats, negative: bool) -> Floats:
    """Return the last three D-H angles (n, 3) given the first three (n, 3)."""
    c1, s1 = np.cos(theta[:, 0]), np.sin(theta[:, 0])
    elevation = theta[:, 1] + theta[:, 2]
    c, s = np.cos(elevation), np.sin(elevation)
    # Columns of the orientation of frame 3: x, y (along axis 2 reversed), z.
    x3 = np.stack([c1 * c, s1 * c, -s], axis=-1)
    y3 = np.stack([s1, -c1, np.zeros_like(c)], axis=-1)
    z3 = np.stack([-c1 * s, -s1 * s, -c], axis=-1)
    rest = np.stack([x3, y3, z3], axis=-2) @ flange[:, :3, :3]
    sign = -1.0 if negative else 1.0
    sine = np.hypot(rest[:, 0, 2], rest[:, 1, 2])
    fourth = np.arctan2(-sign * rest[:, 1, 2], -sign * rest[:, 0, 2])
    fifth = sign * np.arctan2(sine, rest[:, 2, 2])
    sixth = np.arctan2(-sign * rest[:, 2, 1], sign * rest[:, 2, 0])
    return np.stack([fourth, fifth, sixth], axis=-1)


def branch_of(chain: Chain, q: Floats) -> Ints:
    """Return the branch numbers (n,) of joint angles (n, 6) [rad]."""
    theta = chain.dh_angles(q)
    frames = chain.frames(q)
    outward = np.stack([np.cos(theta[:, 0]), np.sin(theta[:, 0])], axis=-1)
    behind = np.sum(frames[:, 4, :2, 3] * outward, axis=-1) < 0
    bend = np.sin(theta[:, 2] + np.arctan2(chain.d[3], chain.a[2]))
    negative = np.sin(theta[:, 4]) < 0
    return np.asarray(WRIST * negative + SHOULDER * behind + ELBOW * (bend < 0))


def nearest_turns(q: Floats, near: Floats) -> Floats:
    """Add the full turns that bring angles (n, 6) closest to (n, 6) or (6,) [rad]."""
    return np.asarray(q + 2 * np.pi * np.round((near - q) / (2 * np.pi)))


# Rotations and poses, written for the virtual arm alone.
#
# The virtual arm is the truth that the rest is tested against, so it shares no
# mathematics with it: not even a rotation.


def about_z(angle: Floats) -> Floats:
    """Rotate about z: (...,) [rad] -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    flat = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1)
    return np.asarray(flat.reshape(*np.shape(angle), 3, 3))


def about_y(angle: Floats) -> Floats:
    """Rotate about y: (...,) [rad] -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    flat = np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=-1)
    return np.asarray(flat.reshape(*np.shape(angle), 3, 3))


def exponential(vector: Floats) -> Floats:
    """Return the rotations (..., 3, 3) of rotation vectors (..., 3) [rad].

    Rodrigues: R = I + sin(t)/t K + (1 - cos(t))/t^2 K^2, K the cross product matrix.
    """
    v = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    K = np.zeros((*v.shape, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    K -= np.swapaxes(K, -1, -2)
    half = np.sinc(angle / (2 * np.pi))
    turned: Floats = np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * (K @ K)
    return turned


def logarithm(R: Floats) -> Floats:
    """Return the rotation vector (3,) [rad] of a rotation (3, 3), angle in [0, pi]."""
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = 0.5 * float(np.linalg.norm(skew)), 0.5 * (float(np.trace(R)) - 1)
    angle = np.arctan2(sine, cosine)
    if sine > 1e-6:
        return np.asarray(skew * (0.5 * angle / sine))
    if cosine > 0:
        return np.asarray(0.5 * skew)
    # Half a turn: the axis is the largest column of R + I.
    columns = R + np.eye(3)
    axis = columns[:, np.argmax(np.diag(R))]
    return np.asarray(angle * axis / np.linalg.norm(axis))


def pose(R: Floats, p: Floats) -> Floats:
    """Join rotations (..., 3, 3) and positions (..., 3) [m] to poses (..., 4, 4)."""
    shape = np.broadcast_shapes(np.shape(R)[:-2], np.shape(p)[:-1])
    T = np.zeros((*shape, 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, p, 1.0
    return T


def pose_of_record(record: Floats) -> Floats:
    """Convert x, y, z, a, e, r (..., 6) [mm, deg] to poses (..., 4, 4) [m].

    R = Rz(a) Ry(e) Rz(r).
    """
    record = np.asarray(record, dtype=float)
    a, e, r = np.moveaxis(np.radians(record[..., 3:6]), -1, 0)
    return pose(about_z(a) @ about_y(e) @ about_z(r), record[..., :3] * 1e-3)


def pose_of_numbers(values: Floats) -> Floats:
    """Convert the numbers of a target (w,) to a pose (4, 4) [m].

    x, y, z [mm] and a, e, r [deg]; or x, y, z and A, B, C about z, y, x with two flags;
    or x, y, z and a quaternion, scalar first, of any length, with what else there is
    behind it.
    """
    if len(values) == 6:
        return pose_of_record(values)
    if len(values) == 8:
        a, b, c = np.radians(values[3:6])
        turned = about_z(a) @ about_y(b) @ exponential(np.array([c, 0.0, 0.0]))
        return pose(turned, values[:3] * 1e-3)
    sine = float(np.linalg.norm(values[4:7]))
    about = values[4:7] / max(sine, 1e-300)
    turned = exponential(2 * np.arctan2(sine, values[3]) * about)
    return pose(turned, values[:3] * 1e-3)


def undo(T: Floats) -> Floats:
    """Invert poses (..., 4, 4)."""
    back = np.swapaxes(T[..., :3, :3], -1, -2)
    return pose(back, -np.einsum("...ij,...j->...i", back, T[..., :3, 3]))


def small_motion(twist: Floats) -> Floats:
    """Return the poses of (..., 6): translation [m], then rotation vector [rad]."""
    return pose(exponential(twist[..., 3:]), twist[..., :3])


# Gravity torques by moments about the joint axes, written for the virtual arm.

GRAVITY = np.array([0.0, 0.0, -9.80665])  # [m/s^2] of an arm on the floor
MOUNTED = {"floor": GRAVITY, "ceiling": -GRAVITY, "wall": -GRAVITY[[2, 0, 1]]}


def gravity_of(mounting: str | Sequence[float] | None, base: Floats) -> Floats:
    """Return the acceleration of gravity in the arm base, (3,) [m/s^2].

    Args:
        mounting: "floor", "ceiling", "wall" or a direction; None: by the base.
        base: World to arm base, (4, 4).
    """
    if mounting is None:
        return np.asarray(undo(base)[:3, :3] @ GRAVITY)
    if isinstance(mounting, str):
        return MOUNTED[mounting]
    along = np.array(mounting, dtype=float)
    return np.asarray(along * (-GRAVITY[2] / np.sqrt(along @ along)))


@dataclass(frozen=True)
class LinkMasses:
    """What the arm weighs.

    Attributes:
        chain: The chain that the weights hang on.
        mass: Link masses, (6,) [kg].
        centre: Their centres in the link frames, (6, 3) [m].
        gravity: Acceleration of gravity in the arm base, (3,) [m/s^2].
    """

    chain: Chain
    mass: Floats
    centre: Floats
    gravity: Floats = field(default_factory=GRAVITY.copy)


def link_torque(body: LinkMasses, q: Floats) -> Floats:
    """Return the torque of the links' weight about every joint.

    tau_j = sense_j z_j . sum_{i >= j} (c_i - o_j) x m_i g, positive along positive
    rotation as the controller counts it; joint 2 of a parallelogram turns axis 3 too.

    Args:
        body: Chain, masses and centres of mass.
        q: Controller joint angles, (n, 6) [rad].

    Returns:
        (n, 6) [N m].
    """
    frames = body.chain.frames(q)
    centre = np.einsum("niab,ib->nia", frames[:, 1:, :3, :3], body.centre)
    centre = centre + frames[:, 1:, :3, 3]
    return _moments(body, frames, centre, body.mass[None, :] + 0 * centre[..., 0])


def total_torque(body: LinkMasses, q: Floats, mass: Floats, com: Floats) -> Floats:
    """Return the torque of links and payload about the joints, (n, 6) [N m].

    Args:
        body: As in `link_torque`.
        q: Controller joint angles, (n, 6) [rad].
        mass: As in `payload_torque`.
        com: Likewise.
    """
    return link_torque(body, q) + payload_torque(body, q, mass, com)


def payload_torque(body: LinkMasses, q: Floats, mass: Floats, com: Floats) -> Floats:
    """Return the torque of a payload about every joint, (n, 6) [N m].

    Args:
        body: The arm.
        q: Controller joint angles, (n, 6) [rad].
        mass: Payload mass, (n,) [kg].
        com: Its centre of mass in the flange frame, (n, 3) [m].
    """
    frames = body.chain.frames(q)
    centre = np.einsum("nab,nb->na", frames[:, 6, :3, :3], com) + frames[:, 6, :3, 3]
    masses = np.zeros_like(q)
    masses[:, 5] = mass
    return _moments(body, frames, np.repeat(centre[:, None], 6, axis=1), masses)


def foundation_moment(body: LinkMasses, q: Floats, mass: Floats, com: Floats) -> Floats:
    """Return the moment of links and payload about the arm's base point, (n, 3) [N m].

    Args:
        body: As in `link_torque`.
        q: Controller joint angles, (n, 6) [rad].
        mass: As in `payload_torque`.
        com: Likewise.
    """
    frames = body.chain.frames(q)
    total = np.zeros((len(q), 3))
    for i in range(6):
        centre = frames[:, i + 1, :3, :3] @ body.centre[i] + frames[:, i + 1, :3, 3]
        total += np.cross(centre, body.mass[i] * body.gravity)
    held = frames[:, 6] @ np.append(com, np.ones((len(q), 1)), axis=1)[..., None]
    return np.asarray(total + np.cross(held[:, :3, 0], mass[:, None] * body.gravity))


def bending_moment(body: LinkMasses, q: Floats, mass: Floats, com: Floats) -> Floats:
    """Return the moment of all weight behind every joint, across its axis.

    Args:
        body: As in `link_torque`.
        q: Controller joint angles, (n, 6) [rad].
        mass: As in `payload_torque`.
        com: Likewise.

    Returns:
        (n, 6, 2) [N m], about x and y of the frame before each joint.
    """
    frames = body.chain.frames(q)
    held = frames[:, 6, :3, 3] + np.einsum("nab,nb->na", frames[:, 6, :3, :3], com)
    out = np.empty((len(q), 6, 2))
    for j in range(6):
        at, axes = frames[:, j, :3, 3], frames[:, j, :3, :2]
        total = np.cross(held - at, mass[:, None] * body.gravity)
        for i in range(j, 6):
            link = frames[:, i + 1]
            centre = link[:, :3, :3] @ body.centre[i] + link[:, :3, 3]
            total += np.cross(centre - at, body.mass[i] * body.gravity)
        out[:, j] = np.einsum("nca,nc->na", axes, total)
    return out


def _moments(body: LinkMasses, frames: Floats, centre: Floats, mass: Floats) -> Floats:
    """Sum the moments about every axis of the masses outward of it."""
    weight = mass[..., None] * body.gravity
    torque = np.empty((len(frames), 6))
    for j in range(6):
        lever = centre[:, j:] - frames[:, j, None, :3, 3]
        moment = np.cross(lever, weight[:, j:]).sum(axis=1)
        torque[:, j] = np.sum(frames[:, j, :3, 2] * moment, axis=-1)
    return body.chain.by_joints(torque)
