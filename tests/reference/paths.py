"""Straight paths and rounded corners, one after the other."""

from __future__ import annotations

import numpy as np

from tests.reference.kinematics import rotation_vector

FLAT, STEP = 4e-5, 0.02  # [rad]; of s


def lines(tool, flange, begin, end):
    """Build straight paths: rotations, turns, begins, chords."""
    out = []
    for i, j in zip(begin, end, strict=True):
        a, b = flange[i] @ tool[j], flange[j] @ tool[j]
        turn = rotation_vector(a[:3, :3].T @ b[:3, :3])
        out.append((a[:3, :3], turn, a[:3, 3], b[:3, 3] - a[:3, 3]))
    return [np.array(column) for column in zip(*out, strict=True)]


def to_move(pull, wanted, rounds):
    """Move targets so that the path moves as wanted: Jacobi's method."""
    moved = np.array(wanted)
    for _ in range(rounds):
        before = np.array(moved)
        for c, at in enumerate(pull.visit):
            aside = pull.v[c] * (before[pull.before[c]] - before[at])
            aside = aside + pull.w[c] * (before[pull.behind[c]] - before[at])
            moved[at] = wanted[at] - aside
    return moved


def along(traced, edge, u):
    """Interpolate on one edge: a parabola through the three nearest samples."""
    edges = traced.edges
    samples = edges.path[edges.start[edge] : edges.start[edge + 1]]
    nodes = np.vstack([traced.q[edges.source[edge]], samples])
    if len(samples) == 1:
        return nodes[1] + (u - 1) * (nodes[1] - nodes[0])
    x = u * len(samples)
    middle = int(np.clip(np.rint(x), 1, len(samples) - 1))
    before, here, after = nodes[middle - 1 : middle + 2]
    t = x - middle
    return here + t * (after - before) / 2 + t**2 / 2 * (after - 2 * here + before)


def on_corner(traced, zones, c, s):
    """Follow a corner: two moves superposed."""
    into = along(traced, zones.into[c], 1 - zones.before[c] * (1 - s) ** 2)
    out = along(traced, zones.out[c], zones.behind[c] * s**2)
    return into + out - traced.q[zones.visit[c]]


def nearest_on_parabola(begin, end):
    """Find the s at which begin (1 - s)^2 + end s^2 is shortest: a fine search."""
    s = np.linspace(0.0, 1.0, 200_001)[:, None]
    away = ((begin * (1 - s) ** 2 + end * s**2) ** 2).sum(axis=1)
    return float(s[np.argmin(away), 0])


def samples(traced, found, pieces):
    """Place the samples of all edges, and their shares of the way."""
    path, share, zones = [], [], found.zones
    for e in range(len(traced.edges.source)):
        behind, ahead = pieces.corner[:, e]
        if behind < 0 and ahead < 0:
            kept = slice(traced.edges.start[e], traced.edges.start[e + 1])
            path += [*traced.edges.path[kept]]
            share += [*traced.share[kept]]
            continue
        leaving, middle, entering = pieces.count[:, e]
        for k in range(1, leaving + 1):
            near, step = found.nearest[behind], (1 - found.nearest[behind]) / leaving
            path.append(_at(traced, found, behind, near + k * step))
            share.append(2 * zones.behind[behind] * step)
        for k in range(1, middle + 1):
            long = (pieces.end[e] - pieces.begin[e]) / middle
            path.append(along(traced, e, pieces.begin[e] + k * long))
            share.append(long)
        for k in range(1, entering + 1):
            step = found.nearest[ahead] / entering
            path.append(_at(traced, found, ahead, k * step))
            share.append(2 * zones.before[ahead] * step)
    return np.array(path), np.array(share)


def _at(traced, found, c, s):
    at_nearest = s == found.nearest[c]
    return found.q[c] if at_nearest else on_corner(traced, found.zones, c, s)
