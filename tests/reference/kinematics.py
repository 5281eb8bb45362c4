"""Chains, closed forms and poses: matrices, one pose after the other."""

from __future__ import annotations

import math

import numpy as np

NAN = np.full(6, np.nan)


def link(a, d, alpha, theta, beta=0.0):
    """Return Rot_z(theta) Trans(a, 0, d) Rot_x(alpha) Rot_y(beta)."""
    turn_z = axis_rotation(2, theta)
    shift = np.eye(4)
    shift[:3, 3] = a, 0.0, d
    return turn_z @ shift @ axis_rotation(0, alpha) @ axis_rotation(1, beta)


def axis_rotation(axis, angle):
    """Rotate about a coordinate axis, (4, 4)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(4)
    out[i, i] = out[j, j] = math.cos(angle) if math.isfinite(angle) else math.nan
    out[j, i] = math.sin(angle) if math.isfinite(angle) else math.nan
    out[i, j] = -out[j, i]
    return out


def flange(dh, q, beta=None):
    """Place the flange, (n, 4, 4)."""
    beta = np.zeros(6) if beta is None else beta
    out = []
    for row in q:
        T = np.eye(4)
        for i, theta in enumerate(dh.offset + dh.sense * (dh.mix @ row)):
            T = T @ link(dh.a[i], dh.d[i], dh.alpha[i], theta, beta[i])
        out.append(T)
    return np.reshape(out, (-1, 4, 4))


def placed(dh, q, point, beta=None):
    """Express points of the flange frame in the base frame, (n, 3)."""
    T, point = flange(dh, q, beta), np.broadcast_to(point, (len(q), 3))
    return np.einsum("nij,nj->ni", T[:, :3, :3], point) + T[:, :3, 3]


def frames(dh, q):
    """Place the frames 0 to 6, (n, 7, 4, 4)."""
    out = np.empty((len(q), 7, 4, 4))
    for k, row in enumerate(q):
        out[k, 0] = np.eye(4)
        for i, theta in enumerate(dh.offset + dh.sense * (dh.mix @ row)):
            out[k, i + 1] = out[k, i] @ link(dh.a[i], dh.d[i], dh.alpha[i], theta)
    return out


def jacobian(dh, q, point):
    """Differentiate points of the flange frame and its rotation, (n, 6, 6)."""
    out, place = np.empty((len(q), 6, 6)), placed(dh, q, point)
    for k, T in enumerate(frames(dh, q)):
        axes, origins = T[:6, :3, 2], T[:6, :3, 3]
        screws = np.hstack([np.cross(axes, place[k] - origins), axes]).T
        out[k] = (screws * dh.sense) @ dh.mix
    return out


def torque(dh, q, links, load):
    """Sum lever times weight of everything that a joint carries, (n, 6)."""
    out, seen = np.zeros((len(q), 6)), frames(dh, q)
    for k, T in enumerate(seen):
        weights = [(T[i + 1], links[i]) for i in range(6)] + [(T[6], load[k])]
        for carried, (frame, (mass, *centre)) in enumerate(weights):
            place = (frame @ [*centre, 1.0])[:3]
            for j in range(min(carried, 5) + 1):
                lever = np.cross(T[j, :3, 2], place - T[j, :3, 3])[2]
                out[k] += mass * lever * dh.sense[j] * dh.mix[j]
    return out


def branch(opw, pose, slot):
    """Solve one pose for one branch, geometric joint angles, NaN where there is none.

    Brandstoetter, Angerer, Hofbaur (2014).
    """
    a1, a2, b, c1, c2, c3, c4 = (
        getattr(opw, f"{name}_mm") / 1000
        for name in ("a1", "a2", "b", "c1", "c2", "c3", "c4")
    )
    x, y, z = pose[:3, 3] - c4 * pose[:3, 2]
    behind, elbow, flip = slot & 2 > 0, -1 if slot & 1 else 1, slot & 4 > 0
    in_plane = x * x + y * y - b * b
    if in_plane < 0:
        return NAN
    reach = math.sqrt(in_plane)
    t1 = math.atan2(y, x) + (
        math.atan2(b, reach) - math.pi if behind else -math.atan2(b, reach)
    )
    out, up = (-reach if behind else reach) - a1, z - c1
    fore, far = math.hypot(a2, c3), math.hypot(out, up)
    cosines = [(far**2 + c2**2 - fore**2) / (2 * far * c2),
               (far**2 - c2**2 - fore**2) / (2 * c2 * fore)]  # fmt: skip
    if max(map(abs, cosines)) > 1:
        return NAN
    t2 = math.atan2(out, up) - elbow * math.acos(cosines[0])
    t3 = elbow * math.acos(cosines[1]) - math.atan2(a2, c3)
    # What the wrist does is left over of the orientation.
    wrist = (axis_rotation(2, t1) @ axis_rotation(1, t2 + t3))[:3, :3].T @ pose[:3, :3]
    t4 = math.atan2(wrist[1, 2], wrist[0, 2])
    t5 = math.atan2(math.hypot(wrist[0, 2], wrist[1, 2]), wrist[2, 2])
    last = (axis_rotation(2, t4) @ axis_rotation(1, t5))[:3, :3].T @ wrist
    t6 = math.atan2(last[1, 0], last[1, 1])
    if flip:
        t4, t5, t6 = t4 + math.pi, -t5, t6 + math.pi
    angles = np.array([t1, t2, t3, t4, t5, t6]) + np.deg2rad(opw.offsets_deg)
    return angles * np.where(opw.flip_axes, -1.0, 1.0)


def pose_from_record(record):
    """Convert one position record [mm, deg] to a pose [m]."""
    x, y, z, a, e, r = record
    turns = [axis_rotation(k, math.radians(t)) for k, t in ((2, a), (1, e), (2, r))]
    out = turns[0] @ turns[1] @ turns[2]
    out[:3, 3] = x / 1000, y / 1000, z / 1000
    return out


def rotation_vector(R):
    """Return the rotation vector of one rotation, of a length in [0, pi].

    The angle by atan2 of sine and cosine, the axis from the skew part, or near half a
    turn from R + I, whose columns lie along it.
    """
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = np.linalg.norm(skew) / 2, (np.trace(R) - 1) / 2
    angle = math.atan2(sine, cosine)
    if cosine > -0.5:
        return skew / 2 * (angle / sine if sine > 0 else 1.0)
    # exp([w]) + exp([w])^T = 2 (cos I + (1 - cos) a a^T)
    outer = (R + R.T) / 2 - cosine * np.eye(3)
    axis = outer[:, np.argmax(np.diag(outer))]
    axis = axis / np.linalg.norm(axis)
    return angle * (axis if axis @ skew >= 0 else -axis)


def into_range(q, lower, upper):
    """Shift one angle by whole turns into a range where that is possible."""
    q = math.pi - np.mod(math.pi - q, math.tau)
    if q < lower and q + math.tau <= upper:
        return q + math.tau
    if q > upper and q - math.tau >= lower:
        return q - math.tau
    return q


def on_turns(q, turns):
    """Put joint angles (n, 6) on written turns (n, 3), see `motion.branches`."""
    out, axes = np.array(q), [3, 5, 2]
    written = ~np.isnan(turns)
    given = np.where(written, turns, 0.0)
    whole = np.floor(given + 0.5)
    middle = math.tau * (given - whole)
    rest = np.mod(q[:, axes] - middle + math.pi, math.tau) - math.pi + middle
    moved = rest + math.tau * whole
    moved[:, 2] = np.where(written[:, 2], moved[:, 2], q[:, 2])
    out[:, axes] = moved
    return out


def departure(dh, old, new, point, offset):
    """Compare joint angles: excess of changes, (n, 6), and displacements, (n, 3)."""
    excess = np.array(new - old)
    for row in excess:
        for j, change in enumerate(row):
            low, high = min(offset[j], 0.0), max(offset[j], 0.0)
            if not math.isnan(change):
                row[j] = max(low - change, change - high, 0.0)
    seen = []
    for q in (old, new):
        at = frames(dh, np.nan_to_num(q))
        tcp = placed(dh, np.nan_to_num(q), point)
        seen.append(np.stack([at[:, 2, :3, 3], at[:, 4, :3, 3], tcp], axis=1))
    moved = np.linalg.norm(seen[1] - seen[0], axis=2)
    moved[np.isnan(old + new).any(axis=1)] = np.nan
    return excess, moved
