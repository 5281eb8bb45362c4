"""Methods are compared on rows that none of them has seen."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tests.written import Desk, cli

METHODS = 7  # with none at all
ROWS = 80


@pytest.fixture(scope="module")
def files(
    job_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """A survey cut in two: in the base frame, and 1 m away as a tracker's."""
    with (job_folder / "survey.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    folder = tmp_path_factory.mktemp("compare")

    def written(name: str, some: list[dict[str, str]], shift: float) -> Path:
        path = folder / name
        with path.open("w", newline="") as out:
            made = csv.DictWriter(out, list(rows[0]))
            made.writeheader()
            for row in some:
                x = float(row["x_mm"]) + shift
                made.writerow({**row, "x_mm": f"{x:.4f}"})
        return path

    first, second = rows[:ROWS], rows[ROWS : ROWS + 30]
    return {
        "data": written("data.csv", first, 0.0),
        "test": written("test.csv", second, 0.0),
        "tracker": written("tracker.csv", first, 1000.0),
        "tracker test": written("tracker-test.csv", second, 1000.0),
    }


def told(desk: Desk, *arguments: object) -> dict[str, object]:
    out = desk.folder / "compared.json"
    found = cli("compare", *arguments, "--cell", desk.cell, "--report", out)
    assert found.exit_code == 0, found.stderr
    return json.loads(out.read_bytes())


def test_files_of_their_own_are_tested(desk: Desk, files: dict[str, Path]) -> None:
    found = told(desk, files["data"], "--test", files["test"])
    assert len(found["rows"]) == METHODS and {r["n"] for r in found["rows"]} == {30}
    assert found["split"] == f"{ROWS} rows to fit, 30 of test.csv to test"
    mean = {row["method"]: row["mean_mm"] for row in found["rows"]}
    assert mean["full"] < 0.3 < mean["no compensation"]


def test_rows_of_a_tracker_are_registered_by_those_that_are_fitted(desk, files) -> None:
    found = told(
        desk,
        files["tracker"],
        "--test",
        files["tracker test"],
        "--set",
        "measurements.frame=tracker",
    )
    mean = {row["method"]: row["mean_mm"] for row in found["rows"]}
    assert mean["full"] < 0.5 and mean["no compensation"] < 10


def test_blocks_are_tested_in_turn(desk: Desk, files: dict[str, Path]) -> None:
    found = told(desk, files["data"], "--cv-blocks", 2)
    assert {row["n"] for row in found["rows"]} == {ROWS}
    assert "2 blocks in their order" in found["split"]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--cv-blocks", 1), "can be cut into 2 to 40 blocks"),
        (("--cv-blocks", 41), "can be cut into 2 to 40 blocks"),
        (
            ("--cv-blocks", 2, "--test", "data"),
            "--test and --cv-blocks: say one of them",
        ),
        (("--test", "absent.csv"), "absent.csv"),
    ],
)
def test_what_cannot_be_tested_is_refused(desk, files, more, said) -> None:
    given = [files.get(str(word), word) for word in more]
    found = cli("compare", files["data"], *given, "--cell", desk.cell)
    assert found.exit_code == 2 and said in found.stderr
