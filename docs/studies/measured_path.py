"""What a tracker that follows the tool tells: flanks in motion, undeclared effects.

    python docs/studies/measured_path.py [--seeds 41 45]

For each virtual arm: a survey of 300 poses from both sides, a model, the job of
docs/studies/paths.py compensated at its targets, run once with a tracker reading at
100 Hz, as the arm is and with each of some effects besides that nobody declared.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import paths

from postproc.robot.cell import load_cell

EFFECTS = ("", "compliance", "transmission", "coupling", "load_backlash", "scale")


def study(seed: int, folder: Path) -> None:
    """Print the rows of one arm."""
    arm = ("--set", f"simulation.seed={seed}")
    place = paths.fit_a_survey(folder, *arm)
    job, ran = folder / "job.pdl", folder / "ran.pdl"
    job.write_text(paths.job(seed, load_cell(place)))
    paths.done("compensate", job, "--cell", place, "--model",
               folder / "model.json", "-o", ran)  # fmt: skip
    for effect in EFFECTS:
        more = ("--set", f"simulation.effects={effect}") if effect else ()
        tell(seed, effect, paths.follow(ran, *arm, *more))


def tell(seed: int, effect: str, told: dict) -> None:
    """Print what was found."""
    flanks = told["path"]["flanks"]
    words = [
        f"{sum(j['verdict'] == word for j in flanks)} {word}"
        for word in ("confirmed", "uncertain", "elsewhere", "refuted")
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
