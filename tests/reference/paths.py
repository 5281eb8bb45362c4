"""Straight paths and rounded corners, one after the other."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from tests.reference.kinematics import rotation_vector

FLAT, STEP = 4e-5, 0.02  # [rad]; of s
EMPTY = 1e-9  # part of a move


def lines(tool, flange, begin, end):
    """Build straight paths: rotations, turns, begins, chords."""
    out = []
    for i, j in zip(begin, end, strict=True):
        a, b = flange[i] @ tool[j], flange[j] @ tool[j]
        turn = rotation_vector(a[:3, :3].T @ b[:3, :3])
        out.append((a[:3, :3], turn, a[:3, 3], b[:3, 3] - a[:3, 3]))
    return [np.array(column) for column in zip(*out, strict=True)]


def stays_within(share, values, weight, first, ways):
    """Return what a share of the weight of some ways stays within."""
    out = []
    for w in ways:
        own = slice(first[w], first[w + 1])
        order = np.argsort(values[own], kind="stable")
        done = np.cumsum(weight[own][order])
        reached = np.argmax(done >= share * done[-1])
        out.append(values[own][order[reached]])
    return np.array(out)


def to_move(pull, wanted, rounds):
    """Move targets so that the path moves as wanted: Jacobi's method."""
    moved = np.array(wanted)
    for _ in range(rounds):
        before = np.array(moved)
        for c, at in enumerate(pull.visit):
            aside = pull.v[c] * (before[pull.before[c]] - before[at])
            aside = aside + pull.w[c] * (before[pull.behind[c]] - before[at])
            aside = aside - (aside @ pull.along[c]) * pull.along[c]
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


def zones(arm, targets, traced):
    """Find corners and what they take of their moves: see `blending`, move by move."""
    source, out = traced.edges.source, []
    to = np.repeat(np.arange(len(targets)), np.diff(targets.pred_start))
    for v in range(len(targets)):
        into = np.flatnonzero(to == v)
        leaving = np.flatnonzero(targets.pred == v)
        rounded = targets.fly[v] and not targets.via[v] and targets.rounding[v] < 3
        if not rounded or len(into) != 1 or len(leaving) != 1 or to[leaving[0]] == v:
            continue
        edges = int(into[0]), int(leaving[0])
        ends = [(source[e], to[e]) for e in edges]
        if min(a for a, _ in ends) < 0 or np.isnan(traced.q[np.array(ends)]).any():
            continue
        share = _shares(arm, targets, traced, v, edges, ends)
        if min(share) > 0:
            out.append((v, *edges, *share))
    return [np.array(column) for column in zip(*out, strict=True)]


def _shares(arm, targets, traced, v, edges, ends):
    """Give the parts of the moves before and behind that a zone takes."""
    places = [[(traced.flange[k] @ targets.tool[b])[:3, 3] for k in (a, b)]
              for a, b in ends]  # fmt: skip
    way = [np.fmax(traced.length[e], np.linalg.norm(p[1] - p[0]))
           for e, p in zip(edges, places, strict=True)]  # fmt: skip
    cartesian = targets.move[v] > 0 and targets.move[ends[1][1]] > 0
    if cartesian and targets.rounding[v] > 0:
        begin = np.inf if targets.rounding[v] == 2 else targets.fly_distance[v]
        return [min(begin, min(way) / 2) / w if min(way) > 1e-9 else 0.0 for w in way]
    push, lasts = [], []
    for (a, b), w in zip(ends, way, strict=True):
        turned = np.maximum(np.abs(traced.q[b] - traced.q[a]), 1e-9)
        push.append((arm.acceleration / turned).min())
        speed = (arm.velocity / turned).min()
        if targets.move[b] > 0:
            speed = np.fmin(speed, targets.linear_speed[b] / w)
        lasts.append(min(speed / push[-1], push[-1] ** -0.5))
    time = targets.overlap[v] * min(lasts)
    return [p * time**2 / 2 for p in push]


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


def one_way(coupling, traced, found):
    """Tell on which edges no drive turns back: straight ones into a corner."""
    zones, edges = found.zones, traced.edges
    one = np.diff(edges.start) == 1
    here = traced.q[zones.visit]
    into = here - traced.q[edges.source[zones.into]]
    out = edges.path[edges.start[zones.out]] - here
    back = (into @ coupling.T) * (out @ coupling.T) < 0
    goes_on = one[zones.into] & one[zones.out] & ~back.any(axis=1)
    before, behind = np.ones_like(one), np.zeros_like(one)
    before[zones.out], behind[zones.into] = goes_on, goes_on
    return before & behind


def pieces_of(traced, found, coupling, most):
    """Cut edges at the ends of zones: corners, begins, ends, and counts of samples."""
    e, zones = len(traced.edges.source), found.zones
    rows = np.arange(len(zones.visit))
    corner = np.full((2, e), -1)
    corner[0, zones.out], corner[1, zones.into] = rows, rows
    begin, end = np.zeros(e), np.ones(e)
    begin[zones.out], end[zones.into] = zones.behind, 1 - zones.before
    flat = (np.abs(found.bend) < FLAT).all(axis=1)
    count = np.zeros((3, e), dtype=np.int64)
    count[0, zones.out] = np.where(flat, 0, most)
    count[2, zones.into] = np.where(flat, 1, most)
    before = np.diff(traced.edges.start)
    inner = np.ceil(before * (end - begin) - EMPTY).astype(np.int64)
    count[1] = np.where(end - begin > EMPTY, np.minimum(inner, before), 0)
    if coupling is not None:
        count[:, one_way(coupling, traced, found)] = [[0], [0], [1]]
    return SimpleNamespace(corner=corner, begin=begin, end=end, count=count)


def uneven(pieces, start):
    """List the samples whose neighbours are not equally far along the path.

    The last one of a piece, and the first one where its piece does not begin at a
    sample because the corner before is flat.
    """
    (first, middle, _), touched = pieces.count, (pieces.corner >= 0).any(axis=0)
    flat = (pieces.corner[0] >= 0) & (first == 0)
    ends = start[:-1] + first, start[:-1] + first + middle
    found = [ends[0][touched & (first > 0)], ends[1][touched & (middle > 0)],
             start[:-1][touched & flat] + 1]  # fmt: skip
    return np.unique(np.concatenate(found)) - 1


def samples(traced, found, coupling, most=4):
    """Place the samples of all edges: their path, shares, starts, and uneven ones."""
    pieces = pieces_of(traced, found, coupling, most)
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
    start = np.concatenate([[0], np.cumsum(pieces.count.sum(axis=0))])
    return np.array(path), np.array(share), start, uneven(pieces, start)


def _at(traced, found, c, s):
    at_nearest = s == found.nearest[c]
    return found.q[c] if at_nearest else on_corner(traced, found.zones, c, s)
