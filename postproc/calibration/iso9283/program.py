"""The program of a test after ISO 9283: poses of the cube, directions and paths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from postproc.arrays import Floats
from postproc.calibration.iso9283.figures import PATH_CYCLES, POSE_CYCLES
from postproc.calibration.pose_design import joint_box, usable
from postproc.calibration.survey_program import SETTLE, language_for
from postproc.exceptions import CellError
from postproc.files import write_all
from postproc.language.measuring_program import (
    SHARE,
    SLOW,
    MeasuringLine,
    MeasuringMove,
    MeasuringProgram,
    MountedProbe,
    name_of_file,
)
from postproc.robot.arm import Arm
from postproc.robot.cell import Cell, as_cell
from postproc.robot.pose import MM

SIZES = (1.0, 0.63, 0.4, 0.25)  # edges of the cube, the largest that fits is used [m]
INSET = 0.8  # P2 to P5 lie a tenth of the diagonals from their ends
PLANE = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0]])  # half edges of the plane
POSES = ("P1", "P2", "P3", "P4", "P5")
CORNERS = np.array([(0, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)], dtype=float)
THREE = ("P1", "P2", "P4")  # poses of the multi-directional variation
DIRECTIONS = {"x": 0, "y": 1, "z": 2}
ASIDE = 0.05  # [m] from where a pose is approached along an axis of the base
STRAIGHT = np.deg2rad(10.0)  # nearest that axis 5 comes to its singularity
TILTS = np.deg2rad([180.0, 135.0, 90.0])  # of the flange's z from up: down to forward
GRID = 9  # places of the cube along x and z that are tried
ALONG = 9  # points of an edge of the rectangle that must be reached


@dataclass(frozen=True, eq=False)
class Cube:
    """Where the cube is, in the arm's base frame.

    Attributes:
        centre: (3,) [m].
        edge: [m].
        rotation: Of the flange at all poses, (3, 3).
        joints: Of the poses P1 to P5, (5, 6) [rad].
    """

    centre: Floats
    edge: float
    rotation: Floats
    joints: Floats

    def places(self, corners: Floats = CORNERS) -> Floats:
        """Place points of the diagonal plane, (k, 2) in -1 .. 1 -> (k, 3) [m]."""
        return np.asarray(self.centre + INSET * self.edge / 2 * (corners @ PLANE))


def find_cube(cell: Cell) -> Cube:
    """Find the largest cube in front of the arm whose poses and paths can be reached.

    Its edges are parallel to the base frame. Of several places the one is taken that
    keeps farthest from limits of the joints.

    Raises:
        CellError: Not even the smallest one can.
    """
    reach = float(np.linalg.norm(cell.arm.flange(np.zeros((1, 6)))[0, :3, 3]))
    places = product(np.linspace(0.2, 1.2, GRID), [0.0], np.linspace(-0.2, 0.8, GRID))
    centres = reach * np.array(list(places))
    for edge in SIZES:
        found = [_best(cell, edge, tilt, centres) for tilt in TILTS]
        cubes = [one for one in found if one is not None]
        if cubes:
            return max(cubes, key=lambda one: one[0])[1]
    problem = f"{cell.arm.name} reaches no cube of {SIZES[-1] / MM:g} mm in front of it"
    cure = "Check the tool, the limits of the arm and its probe points"
    raise CellError(cell.path, problem, cure)


def _best(
    cell: Cell, edge: float, tilt: float, centres: Floats
) -> tuple[float, Cube] | None:
    """Return the best place of a cube with its margin [rad], None where none fits."""
    turn = _flange_rotation(tilt)
    best: tuple[float, Cube] | None = None
    for centre in centres:
        cube = Cube(centre, edge, turn, np.empty((0, 6)))
        margin, joints = _reach(cell, cube)
        if margin > 0.0 and (best is None or margin > best[0]):
            best = margin, Cube(centre, edge, turn, joints)
    return best


def _flange_rotation(tilt: float) -> Floats:
    """Point the flange's z so far from up, towards the front: (3, 3)."""
    c, s = np.cos(tilt), np.sin(tilt)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _reach(cell: Cell, cube: Cube) -> tuple[float, Floats]:
    """Return the smallest margin to limits and singularities, and joints of the poses.

    The margin [rad] is negative where a point is out of reach.
    """
    solutions = cell.arm.inverse(flange_poses(cell, cube, _stations(cube))).q
    margin = np.min(_margins(cell.arm, solutions), axis=0)
    slot = int(np.argmax(margin))
    q = solutions[:, slot]
    if margin[slot] > 0.0 and not usable(cell.arm, q, _probe(cell, q), None).all():
        return -1.0, q
    return float(margin[slot]), q[: len(POSES)]


def _probe(cell: Cell, q: Floats) -> Floats:
    return np.broadcast_to(cell.probes[0], (len(q), 3))


def _margins(arm: Arm, q: Floats) -> Floats:
    """Return how far joints keep from limits and straight wrists, (.., 6) -> (..)."""
    low, high = joint_box(arm)
    inside = np.minimum(q - low, high - q).min(axis=-1)
    bent = np.abs(np.sin(q[..., 4])) - np.sin(STRAIGHT)
    return np.asarray(np.nan_to_num(np.minimum(inside, bent), nan=-1.0))


def _stations(cube: Cube) -> Floats:
    """List what must be reached: the poses first, their approaches, and the paths."""
    poses = cube.places()
    aside = [poses[k] - ASIDE * np.eye(3) for k in (0, 1, 3)]
    ring = [*poses[1:], poses[1]]
    share = np.linspace(0.0, 1.0, ALONG)[:, None]
    edges = [a + share * (b - a) for a, b in pairwise(ring)]
    return np.concatenate([poses, *aside, *edges])


def flange_poses(cell: Cell, cube: Cube, places: Floats) -> Floats:
    """Return the flange poses (k, 4, 4) that bring the probe point to places (k, 3)."""
    T = np.tile(np.eye(4), (len(places), 1, 1))
    T[:, :3, :3] = cube.rotation
    T[:, :3, 3] = places - cube.rotation @ cell.probes[0]
    return T


def write_iso_program(cell: Cell | str | Path, output: Path) -> str:
    """Write the program of a test.

    Args:
        cell: The cell, or its file: arm, first probe point, payload.
        output: The program to write; its suffix names the language.

    Returns:
        What was written, in words.

    Raises:
        CellError: The arm reaches no cube.
        ProgramError: The arm has a controller of another language.
        OutputError: The program cannot be written.
    """
    cell = as_cell(cell)
    language = language_for(cell, output)
    cube = find_cube(cell)
    program = _program(cell, cube, name_of_file(output.stem))
    write_all({output: language.write_measuring(program, output).encode("ascii")})
    place = ", ".join(f"{v / MM:.0f}" for v in cube.centre)
    measured = sum(isinstance(s, MeasuringMove) and bool(s.measured)
                   for s in program.steps)  # fmt: skip
    return (
        f"{output}: {measured} measurements, {POSE_CYCLES} cycles of {len(POSES)} "
        f"poses and of {len(THREE)} poses from {len(DIRECTIONS)} directions; a line "
        f"and a rectangle {PATH_CYCLES} times\ncube of {cube.edge / MM:g} mm, centre "
        f"at {place} mm in the base frame, probe point 1"
    )


def _program(cell: Cell, cube: Cube, name: str) -> MeasuringProgram:
    probe = tuple((cell.probes[0] / MM).tolist())
    heading = (
        f"Test of {cell.arm.name} after ISO 9283: cube of {cube.edge / MM:g} mm",
        f"Joint moves at {SHARE} % of the speed of the axes, lines at {SLOW:g} mm/s.",
        "After a MEASURE comment: read the tracker when the next move has settled.",
        "Lines that are flown through: read the tracker while the arm moves.",
    )
    steps = (
        MountedProbe(1, probe),
        *_pose_cycles(cube),
        *_directions(cell, cube),
        *_paths(cell, cube),
    )
    centre = tuple((cell.payload_com / MM).tolist())
    return MeasuringProgram(name, heading, steps, SETTLE, cell.payload_mass, centre)


def _move(q: Floats, measured: str = "") -> MeasuringMove:
    return MeasuringMove(tuple(np.rad2deg(q).tolist()), measured)


def _pose_cycles(cube: Cube) -> Iterator[MeasuringMove]:
    """Go from P5 down to P1, 30 times, behind one arrival at P1."""
    yield _move(cube.joints[0])
    for cycle in range(1, POSE_CYCLES + 1):
        for k in reversed(range(len(POSES))):
            yield _move(cube.joints[k], f"{POSES[k]}.{cycle}")


def _directions(cell: Cell, cube: Cube) -> Iterator[MeasuringMove]:
    """Approach three poses along the axes of the base, 30 times."""
    approach = {}
    for name in THREE:
        at = POSES.index(name)
        aside = cube.places()[at] - ASIDE * np.eye(3)
        near = np.tile(cube.joints[at], (3, 1))
        approach[name] = cell.arm.nearest(flange_poses(cell, cube, aside), near)
    for cycle in range(1, POSE_CYCLES + 1):
        for name, (side, axis) in product(THREE, DIRECTIONS.items()):
            yield _move(approach[name][axis])
            yield _move(cube.joints[POSES.index(name)], f"{name}.{side}.{cycle}")


def _paths(cell: Cell, cube: Cube) -> Iterator[MeasuringMove | MeasuringLine]:
    """Follow the line from P2 to P4 and the rectangle P2 to P5, 10 times each."""
    places = {k: _line(cell, cube, k) for k in range(len(POSES))}
    for _ in range(PATH_CYCLES):
        yield _move(cube.joints[1])
        yield places[3]
    for _ in range(PATH_CYCLES):
        yield _move(cube.joints[1])
        for k in (2, 3, 4):
            yield replace(places[k], flown=True)
        yield places[1]


def _line(cell: Cell, cube: Cube, k: int) -> MeasuringLine:
    """Lead to a pose along a line, and stop there."""
    flange = flange_poses(cell, cube, cube.places()[[k]])[0]
    probe = np.eye(4)
    probe[:3, 3] = cell.probes[0]
    world = cell.base.pose @ flange @ probe
    joints = tuple(np.rad2deg(cube.joints[k]).tolist())
    slot = int(cell.arm.branch(cube.joints[[k]])[0])
    return MeasuringLine(world, joints, slot)
