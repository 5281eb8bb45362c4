"""Path accuracy on the paths of ISO 9283: a rectangle, a large and a small circle.

    python docs/studies/iso_paths.py [--seeds 41 45]

In the diagonal plane of a cube of 600 mm in front of the arm, its centre in the
middle of that plane: a rectangle of 0.8 times the plane, circles of 0.8 and 0.1 times
the cube's edge, at 10, 50 and 100 % of 1 m/s. The rectangle's corners are flown through
with zones of 5 mm, a circle is two half arcs, flown through too. Each virtual arm is
surveyed at 300 poses and with reversals, the programs are compensated, and the arm runs
all of them. The last programs know what a tracker read that followed the job of
`paths.py`.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import paths

from postproc.robot.cell import Cell, load_cell

CUBE = 0.6  # [m]
RATED = 1.0  # [m/s]
SPEEDS = (0.1, 0.5, 1.0)
SHAPES = ("rectangle", "large circle", "small circle")
ZONE = 5.0  # [mm]


def plane(cell: Cell) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a pose in the middle of the cube, and the plane's unit vectors."""
    middle = cell.arm.flange(paths.CENTRE[None])[0] @ cell.tool.pose
    return middle, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 1.0]) / np.sqrt(2)


def places(shape: str) -> list[tuple[float, float]]:
    """Give the corners of a shape, or the ends and middles of its half arcs."""
    if shape == "rectangle":
        a, b = 0.4 * CUBE, 0.4 * np.sqrt(2) * CUBE
        return [(-a, -b), (a, -b), (a, b), (-a, b), (-a, -b)]
    r = {"large circle": 0.4, "small circle": 0.05}[shape] * CUBE
    return [(r, 0.0), (0.0, r), (-r, 0.0), (0.0, -r), (r, 0.0)]


def moves(shape: str, cell: Cell) -> Iterator[str]:
    """Write the moves of a shape, twice round: the second time it is flown into."""
    middle, u, v = plane(cell)
    poses = []
    for a, b in places(shape):
        pose = middle.copy()
        pose[:3, 3] += a * u + b * v
        poses.append(paths.pos(pose))
    yield f"  MOVE LINEAR TO {poses[0]}"
    for turn in range(2):
        steps = poses[1:] if shape == "rectangle" else poses[2::2]
        for k, end in enumerate(steps):
            last = turn == 1 and k == len(steps) - 1
            word = "MOVE" if last else "MOVEFLY"
            way = f"LINEAR TO {end}"
            if shape != "rectangle":
                way = f"CIRCULAR TO {end} VIA {poses[2 * k + 1]}"
            yield f"  {word} {way}" + ("" if last else " ADVANCE")


def program(shape: str, share: float, cell: Cell) -> str:
    """Write the program of a shape at a share of the rated speed."""
    head = [
        *paths.START[:2],
        f"  $LIN_SPD := {share * RATED:g}",
        "  $FLY_TYPE := FLY_CART",
        "  $FLY_TRAJ := FLY_FROM",
        f"  $FLY_DIST := {ZONE:g}",
    ]
    return "\n".join(
        ["PROGRAM job", "BEGIN", *head, *moves(shape, cell), "END job", ""]
    )


def study(seed: int, folder: Path) -> None:
    """Print the figures of one arm."""
    arm = ("--set", f"simulation.seed={seed}")
    place = paths.fit_a_survey(folder, *arm, reversals=paths.REVERSALS)
    cell, at = load_cell(place), ("--cell", place)
    job, ran = folder / "job.pdl", folder / "ran.pdl"
    job.write_text(paths.job(seed, cell))
    paths.done("compensate", job, *at, "--model", folder / "model.json", "-o", ran)
    paths.follow(ran, *arm)
    for shape in SHAPES:
        rows = {}
        for share in SPEEDS:
            rows[share] = figures(shape, share, cell, at, arm, folder)
        for row in dict.fromkeys(rows.values()):
            speeds = [f"{100 * share:.0f}" for share in SPEEDS if rows[share] == row]
            print(f"| {seed} | {shape} | {', '.join(speeds)} % | {row}", flush=True)


def figures(
    shape: str,
    share: float,
    cell: Cell,
    at: tuple[object, ...],
    arm: tuple[object, ...],
    folder: Path,
) -> str:
    """Compensate a shape with and without points on its ways, and run all four."""
    source, made = folder / "job.pdl", folder / "made.pdl"
    source.write_text(program(shape, share, cell))
    found = [scored(source, source, at, arm, folder)]
    for model, more in (
        ("model.json", ()),
        ("model.json", paths.PROGRAMS["points"]),
        ("better.json", paths.PROGRAMS["measured"]),
    ):
        known = ("--model", folder / model)
        paths.done("compensate", source, *at, *known, "-o", made, *more)
        found.append(scored(made, source, at, arm, folder))
    cells = [f"{mean:.3f} | {most:.3f}" for mean, most in found]
    return " | ".join(cells) + " |"


def scored(
    run: Path, source: Path, at: tuple[object, ...], arm: tuple[object, ...], to: Path
) -> tuple[float, float]:
    """Let the arm run a program; mean along the shape and AT_p, second time round."""
    told = to / "true.json"
    paths.done(
        "simulate", run, *at, *arm, "--path", "--reference", source, "--report", told
    )
    own = json.loads(told.read_bytes())["path"]
    second = own[len(own) // 2 + 1 :] if len(own) > 2 else own
    return (
        float(np.mean([move["p95_mm"] for move in second])),
        max(move["max_mm"] for move in second),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(41, 45))
    first, last = parser.parse_args().seeds
    print(
        "| arm | path | speed | as written: 95 % along, mm | AT_p | compensated: "
        "95 % along, mm | AT_p | with points: 95 % along, mm | AT_p | .. and a track: "
        "95 % along, mm | AT_p |\n|---|---|---|---|---|---|---|---|---|---|---|"
    )
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            study(seed, Path(folder))


if __name__ == "__main__":
    main()
