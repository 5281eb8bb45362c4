"""What a tracker that follows the tool tells: flanks in motion, undeclared effects.

    python docs/studies/measured_path.py [--seeds 41 45]

For each virtual arm: a survey of 300 poses from both sides, a model, the job of
docs/studies/paths.py compensated at its targets, run once with a tracker reading at
100 Hz, as the arm is and with each of some effects besides that nobody declared.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import paths

from postproc.robot.cell import load_cell

EFFECTS = ("", "compliance", "transmission", "coupling", "load_backlash", "scale")


def study(seed: int, folder: Path) -> None:
    """Print the rows of one arm."""
    place = folder / "cell.toml"
    place.write_text(paths.CELL)
    (folder / "job.pdl").write_text(paths.job(seed, load_cell(place)))
    at, arm = ("--cell", place), ("--seed", seed)
    model = ("--model", folder / "model.json")
    paths.done("survey", *at, "--poses", 300, "-o", folder / "survey.pdl")
    paths.done("simulate", folder / "survey.pdl", *at, *arm, "-o", folder / "s.csv")
    paths.done("fit", folder / "s.csv", *at, "-o", folder / "model.json")
    ran = folder / "ran.pdl"
    paths.done("compensate", folder / "job.pdl", *at, *model, "-o", ran)
    for effect in EFFECTS:
        more = ("--effects", effect) if effect else ()
        track = ("--track", folder / "track.csv")
        paths.done("simulate", ran, *at, *arm, *track, *more)
        told = folder / "told.json"
        paths.done("diagnose", "--path", folder / "track.csv", "--program", ran, *at,
                   *model, "-o", folder / "better.json", "--json", told)  # fmt: skip
        tell(seed, effect, json.loads(told.read_bytes()))


def tell(seed: int, effect: str, told: dict) -> None:
    """Print what was found."""
    flanks = told["path"]["flanks"]
    words = [
        f"{sum(j['verdict'] == word for j in flanks)} {word}"
        for word in ("confirmed", "not sure", "elsewhere", "refuted")
    ]
    found = ", ".join(e["effect"] for e in told["effects"]) or told["verdict"]
    print(
        f"{seed:4d}  {effect or '-':14}  {found:32}  {told['before']['mean_mm']:.4f}"
        f" -> {told['after']['mean_mm']:.4f}  {'; '.join(words)}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs=2, default=(41, 45))
    first, last = parser.parse_args().seeds
    print(" arm  undeclared      found                             mean mm  flanks")
    for seed in range(first, last + 1):
        with tempfile.TemporaryDirectory() as folder:
            study(seed, Path(folder))


if __name__ == "__main__":
    main()
