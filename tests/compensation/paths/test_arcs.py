"""Arcs that are cut: where pieces lie, what may be, and that nothing else changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from postproc.arrays import Floats
from postproc.compensation.paths.arcs import (
    BENT,
    FLAT,
    CutArc,
    WantedArcs,
    flat_pieces,
    hindrances_of_arcs,
    measure_passing,
)
from postproc.compensation.paths.meant_sides import MeantSides
from postproc.compensation.paths.split_constraints import CLOSEST, shortest_pieces
from postproc.compensation.paths.write_points import PathPoints, are_near, insert
from postproc.compensation.program import ParsedProgram, plan_visits, read_program
from postproc.language.languages import language_of
from postproc.motion.cycle_time import run
from postproc.robot.cell import load_cell
from postproc.robot.pose import MM, rotation_vector
from tests.written import program

CELL = load_cell(Path(__file__).parents[3] / "programs/cell.toml")
MIDDLE, RADIUS = np.array([150.0, -40.0, 180.0]), 120.0  # [mm]
TURN = (80.0, 160.0, 10.0)
VIA, END = 1, 2  # visits of the arc; 0 is its start


def place(degrees: float) -> Floats:
    """Place a point on a circle that lies askew."""
    u, v = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.8, 0.6])
    angle = np.deg2rad(degrees)
    return MIDDLE + RADIUS * (np.cos(angle) * u + np.sin(angle) * v)


def pos(degrees: float, turn: tuple[float, ...] = TURN) -> str:
    numbers = ", ".join(f"{x:.4f}" for x in (*place(degrees), *turn))
    return f"POS({numbers}, '')"


def read(
    angles: tuple[float, float, float] = (0.0, 50.0, 170.0),
    via: str = "",
    end_turn: tuple[float, ...] = TURN,
) -> ParsedProgram:
    begin, middle, end = angles
    text = program(
        "$FLY_TYPE := FLY_CART",
        "$FLY_TRAJ := FLY_PASS",
        f"p := {pos(middle)}",
        f"MOVE JOINT TO {pos(begin)}",
        f"MOVE CIRCULAR TO {pos(end, end_turn)} VIA {via or pos(middle)}",
        f"MOVE LINEAR TO {pos(begin)}",
        declared="p : POSITION",
    )
    return read_program({"job.pdl": text}, CELL)


def off_the_circle(numbers: Floats) -> Floats:
    """How far places (k, 3) [mm] are from the circle."""
    normal = np.array([0.0, -0.6, 0.8])
    rel = numbers - MIDDLE
    height = rel @ normal
    radial = np.linalg.norm(rel - height[:, None] * normal, axis=1)
    return np.hypot(height, radial - RADIUS)


def angle_of(numbers: Floats) -> float:
    u, v = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.8, 0.6])
    rel = numbers - MIDDLE
    return float(np.rad2deg(np.arctan2(rel @ v, rel @ u)))


def test_pieces_lie_on_the_arc_their_ways_halved() -> None:
    visits = read().visits
    points = {VIA: (0.4, 1.0), END: (0.5, 0.75)}
    pieces, via = CutArc.of(visits, points, VIA, ()).pieces()
    ends = [piece.end for piece in pieces]
    assert [end is None for end in ends] == [False, True, False, False]
    told = np.array([end for end in ends if end is not None])
    ways = np.array([piece.via for piece in pieces])
    assert off_the_circle(np.vstack([told, ways, via])[:, :3]).max() < 2e-4
    np.testing.assert_allclose([angle_of(p[:3]) for p in told], [20, 110, 140], 1e-5)
    wanted = [10.0, 35.0, 80.0, 125.0]
    np.testing.assert_allclose([angle_of(p[:3]) for p in ways], wanted, 1e-5)
    assert angle_of(via[:3]) == pytest.approx(155.0, abs=1e-3)
    np.testing.assert_allclose(np.vstack([told, ways])[:, 3:], [TURN] * 7, atol=1e-6)


def test_a_piece_that_hardly_bends_is_a_chord() -> None:
    visits = read().visits
    flat = 2 * np.arccos(1 - FLAT / (RADIUS * MM)) / np.deg2rad(50.0)
    for share, chord in ((0.9 * flat, True), (1.1 * flat, False)):
        pieces, _ = CutArc.of(visits, {VIA: (share, 1.0)}, VIA, ()).pieces()
        assert (pieces[0].via is None) is chord and pieces[1].via is not None
    pieces, _ = CutArc.of(visits, {VIA: (0.5, 1.0)}, VIA, {(VIA, 1.0)}).pieces()
    assert pieces[0].via is not None and pieces[1].via is None


@pytest.mark.parametrize("first", [(1.0,), (0.25, 1.0)])
@pytest.mark.parametrize("second", [(), (0.5,), (0.01, 0.5)])
def test_a_program_with_cut_arcs_is_the_same_without_points(
    first: tuple[float, ...], second: tuple[float, ...]
) -> None:
    reading = read()
    points = {VIA: first, **({END: second} if second else {})}
    splitter = language_of("job.pdl").splitter(reading.sources)
    assert splitter is not None
    found, own = insert(reading, PathPoints(points), splitter, CELL)
    v, w = reading.visits, found.visits
    assert len(own) == len(v)
    np.testing.assert_array_equal(
        w.target.values[own], v.target.values
    )  # its numbers stay
    assert not w.motion.via[own].any() and w.motion.via[own[END] - 1]
    ends = np.setdiff1d(np.flatnonzero(~w.motion.via), own)
    assert len(ends) == len(first) + len(second) - 1
    assert off_the_circle(w.target.values[own[0] + 1 : own[END], :3]).max() < 2e-3


def test_the_tool_is_turned_at_the_point_on_the_way_as_well() -> None:
    reading = read()
    splitter = language_of("job.pdl").splitter(reading.sources)
    assert splitter is not None
    points = {VIA: (0.4, 1.0), END: (0.5,)}
    turned = np.array([[0.0, 0.0, 1e-4], [0.0, 0.0, 3e-4], [0.0, 0.0, 2e-4]])
    meant = {
        VIA: MeantSides(np.zeros((2, 6)), turned[:2], np.zeros((3, 6))),
        END: MeantSides(np.zeros((1, 6)), turned[2:], np.zeros((2, 6))),
    }
    found, own = insert(reading, PathPoints(points, meant=meant), splitter, CELL)
    v, w = reading.visits, found.visits
    poses = w.dialect.poses(w.target.values[own[0] + 1 : own[END] + 1])
    turn = rotation_vector(poses[0, :3, :3].T @ poses[:, :3, :3])
    base = rotation_vector(
        v.dialect.poses(v.target.values[[0]])[0, :3, :3].T @ poses[:1, :3, :3]
    )
    np.testing.assert_allclose(
        (base + turn)[:, 2],
        [0.5e-4, 1e-4, 2e-4, 3e-4, 2.5e-4, 2e-4, 1e-4, 0.0],
        atol=4e-6,
    )
    np.testing.assert_allclose(
        w.target.values[own][:, :3], v.target.values[:, :3], atol=6e-4
    )
    np.testing.assert_array_equal(w.target.values[own[END]], v.target.values[END])


def test_the_last_piece_of_an_arc_is_long_enough_to_bend() -> None:
    visits = read().visits
    cycle = run(CELL.arm, plan_visits(visits, CELL).targets)
    pieces = shortest_pieces(visits, cycle, 0.0, cycle.targets.linear_speed)
    assert [behind for _, _, behind in pieces[VIA : END + 2]] == [
        CLOSEST,
        pytest.approx(np.sqrt(16.0 * RADIUS * MM * FLAT), rel=1e-6),
        CLOSEST,
    ]
    share = 1.0 - pieces[END][2] / (RADIUS * MM * np.deg2rad(120.0))
    arc = CutArc.of(visits, {VIA: (1.0,), END: (share,)}, VIA, ())
    assert arc.sagitta(1, share, 1.0) == pytest.approx(2 * FLAT, rel=1e-3)


def test_half_way_between_points_of_an_arc_joints_are_meant_to_lie_between() -> None:
    reading = read()
    splitter = language_of("job.pdl").splitter(reading.sources)
    assert splitter is not None
    points, side = {VIA: (0.4, 1.0), END: (0.5,)}, np.ones((4, 6)) * [1, 1, 1, 0, 0, 1]
    none = np.zeros((2, 3))
    meant = {
        VIA: MeantSides(side[:2], none, np.array([[-0.9], [-0.8], [-0.7]]) * side[:3]),
        END: MeantSides(-side[:1], none[:1], np.array([[0.6], [0.5]]) * side[:2]),
    }
    chords = {(VIA, 1.0)}
    found, own = insert(
        reading, PathPoints(points, chords=chords, meant=meant), splitter, CELL
    )
    assert found.aims is not None
    rows = slice(int(own[0]) + 1, int(own[END]) + 1)
    assert found.visits.motion.via[rows].tolist() == [1, 0, 0, 1, 0, 1, 0]
    np.testing.assert_array_equal(
        found.aims[rows, 0], [-0.9, 1.0, 1.0, 0.6, -1.0, 0.5, np.nan]
    )


def test_what_is_turned_too_far_or_moved_is_another_program() -> None:
    visits = read().visits
    for column, off, near in (
        (0, 1e-3, True),
        (0, 5e-3, False),
        (5, 0.1, True),
        (5, 0.2, False),
    ):
        values = np.array(visits.target.values)
        values[VIA, column] += off
        assert (
            are_near(visits, visits.with_columns(values=values), np.array([VIA]))
            is near
        )


def test_arcs_that_are_cut_lead_where_they_led() -> None:
    reading = read()
    splitter = language_of("job.pdl").splitter(reading.sources)
    assert splitter is not None
    points = {VIA: (0.4, 1.0), END: (0.5,)}
    found, own = insert(reading, PathPoints(points), splitter, CELL)
    cycles = [run(CELL.arm, plan_visits(r.visits, CELL).targets)
              for r in (reading, found)]  # fmt: skip
    before, after = cycles
    owner = np.searchsorted(own, np.arange(len(found.visits)))
    arcs = WantedArcs.of(before, reading.visits.graph.before, [VIA])
    edges = after.path.edges
    to = np.repeat(np.arange(len(owner)), np.diff(edges.start))
    tools = after.targets.tool[to, :3, 3]
    place_ = CELL.arm.tcp(edges.path, tools)
    off = arcs.off(place_, owner[to], np.ones(len(to), dtype=bool))
    on = np.isin(owner[to], [VIA, END])
    assert on.any() and np.linalg.norm(off[on], axis=1).max() < 2e-4
    assert np.linalg.norm(off[~on], axis=1).max() == 0.0
    moved = arcs.off(place_ + 1e-3 * arcs.normal[0], owner[to], on)
    step = moved[on] - off[on] - 1e-3 * arcs.normal[0]
    assert np.abs(step).max() < 1e-6


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, ""),
        ({"via": "p"}, "variable"),
        ({"end_turn": (80.0, 150.0, 10.0)}, "how the tool turns"),
    ],
)
def test_what_is_not_sure_of_an_arc_leaves_it(given: dict[str, str], said: str) -> None:
    visits = read(**given).visits  # type: ignore[arg-type]
    alike = np.ones(len(visits), dtype=bool)
    found = [why for bad, why in hindrances_of_arcs(visits, alike) if bad[VIA]]
    assert any(said in why for why in found) if said else not found
    for bad, _ in hindrances_of_arcs(visits, alike):
        assert bad[VIA] == bad[END] and not bad[0] and not bad[3]


def test_a_tool_that_turns_evenly_may_turn() -> None:
    end, half = (80.0, 160.0, 50.0), (80.0, 160.0, 10.0 + 40.0 * 50 / 170)
    visits = read(via=pos(50.0, half), end_turn=end).visits
    told = hindrances_of_arcs(visits, np.ones(len(visits), dtype=bool))
    assert not any(bad.any() for bad, _ in told)
    pieces, _ = CutArc.of(visits, {VIA: (1.0,), END: (0.5,)}, VIA, ()).pieces()
    assert pieces[1].end is not None
    assert pieces[1].end[5] == pytest.approx(10.0 + 40.0 * 110 / 170, abs=1e-4)


def test_flat_is_less_than_five_times_what_corrections_differ_by() -> None:
    visits = read((0.0, 5.0, 10.0)).visits
    bent = RADIUS * (1 - np.cos(np.deg2rad(5.0))) * MM
    for share, flat in ((0.9, False), (1.1, True)):
        moved = np.zeros((len(visits), 3))
        moved[VIA, 1] = share * bent / BENT
        found = flat_pieces(visits, moved, np.array([VIA]))
        assert [end for end, _ in found] == [END] * flat
        if flat:
            assert found[0][1] == pytest.approx(bent, rel=1e-3)


def test_what_corrections_change_evenly_bends_nothing() -> None:
    visits = read((0.0, 5.0, 10.0)).visits
    moved = np.zeros((len(visits), 3))
    moved[[VIA - 1, VIA, END], 2] = 1e-3, 2e-3, 3e-3
    assert not flat_pieces(visits, moved, np.array([VIA]))
    moved[VIA, 2] += 1e-3
    assert flat_pieces(visits, moved, np.array([VIA]))


def test_two_arcs_that_are_superposed_pass_their_point() -> None:
    radius, zone = 0.12, 5e-3
    rest = np.array([zone / 4, -zone / 4]) / radius  # of either, in the middle
    places = radius * np.array([np.cos(rest), np.sin(rest)]).T - [radius, 0.0]
    far = float(np.linalg.norm(places.sum(axis=0)))
    assert measure_passing(np.array([zone]), radius)[0] == pytest.approx(far, rel=1e-3)
