"""A program of another controller than the arm has is refused."""

from __future__ import annotations

import pytest

from postproc.compensation.compensate import compensate
from postproc.exceptions import CellError
from postproc.robot.arm_file import arm_path as find_arm
from postproc.robot.arm_file import list_shipped_arms, read_arm_file
from postproc.robot.cell import load_cell
from postproc.robot.machine_data import TEMPLATE
from tests.cli.test_languages import NAMES
from tests.language.neutral_job import LANGUAGES, drawn

ROWS = (("pdl2", "job.pdl", "comau"), ("rapid", "job.mod", "abb"),
        ("krl", "job.src", "kuka"))  # fmt: skip
SAID = "absolute_accuracy = false"


def cell_of(folder, controller, arm="nj220-2.7"):
    """Write and load a cell."""
    text = f'[robot]\narm = "{arm}"\n{SAID}\n{controller}\n'
    (folder / "cell.toml").write_text(text)
    return load_cell(folder / "cell.toml")


def outcome(name, cell, model, job):
    files = LANGUAGES[name](job)
    pages = {n: d for n, d in files.items() if n != name}
    return compensate(files[name], cell, model, name=name, pages=pages)


@pytest.mark.parametrize(("_", "name", "own"), ROWS)
def test_a_program_of_another_controller_is_refused(
    _, name, own, bench_cell, bench_model, tmp_path
):
    job = drawn(bench_cell, 1, 3)
    for other in {"comau", "abb", "kuka", "other"} - {own}:
        cell = cell_of(tmp_path, f'controller = "{other}"')
        with pytest.raises(CellError, match=f'of {other}.*controller = "{own}"'):
            outcome(name, cell, bench_model, job)
    cell = cell_of(tmp_path, f'controller = ["{own}", "other"]')
    found = outcome(name, cell, bench_model, job)
    assert "controller" not in {d.code for d in found.diagnostics}


def test_the_arm_file_says_whose_controller_it_is(bench_cell, bench_model, tmp_path):
    cell = cell_of(tmp_path, "")
    with pytest.raises(CellError, match=r"\$\.robot\.arm"):
        outcome("job.src", cell, bench_model, drawn(bench_cell, 1, 3))


def test_an_arm_without_a_controller_gets_one_note(bench_cell, bench_model, tmp_path):
    text = find_arm("nj220-2.7").read_text().replace('controller = "comau"\n', "")
    (tmp_path / "own.toml").write_text(text)
    cell = cell_of(tmp_path, "", arm="own.toml")
    for name in NAMES.values():
        found = outcome(name, cell, bench_model, drawn(bench_cell, 1, 3))
        notes = [d for d in found.diagnostics if d.code == "controller"]
        assert len(notes) == 1 and "controller = " in notes[0].message


def test_shipped_arms_and_machine_data_name_a_controller():
    for name in list_shipped_arms():
        assert read_arm_file(find_arm(name)).controller, name
    assert 'controller = "kuka"' in TEMPLATE


def test_a_controller_must_be_a_known_one(tmp_path):
    with pytest.raises(CellError, match=r"\$\.robot\.controller"):
        cell_of(tmp_path, 'controller = "kuka.krc4"')
