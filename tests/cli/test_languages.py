"""Every command in every language, as docs/languages.md says."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.robot.cell import load_cell
from postproc.robot.trajectory import Motion
from tests.language.neutral_job import LANGUAGES, NeutralMove, drawn
from tests.written import Desk, cli

ROOT = Path(__file__).parents[2]
NAMES = dict(zip(("PDL2", "RAPID", "KRL"), LANGUAGES, strict=True))
ARM = ("--set", "simulation.seed=4")
SAID = "absolute_accuracy = false"


def cells():
    """Read the table: command, language, what is said."""
    text = (ROOT / "docs/languages.md").read_text(encoding="utf-8")
    part = text.split("## Command by language")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in part.splitlines() if line[:1] == "|"]
    head, _, *body = [[cell.strip() for cell in row] for row in rows]
    return [
        (row[0], language, cell)
        for row in body
        for language, cell in zip(head[1:], row[1:], strict=True)
    ]


@pytest.fixture
def place(job_folder, job_cell, tmp_path):
    """A desk with a cell that says what RAPID needs, and a job in every language."""
    text = (job_folder / "cell.toml").read_text().replace("[tool]", f"{SAID}\n[tool]")
    (tmp_path / "cell.toml").write_text(text)
    shutil.copy(job_folder / "model.json", tmp_path)
    for name, write in LANGUAGES.items():
        folder = tmp_path / "tree" / name
        folder.mkdir(parents=True)
        for part, data in write(drawn(job_cell, 5, 12)).items():
            (folder / part).write_bytes(data)
    return Desk(tmp_path, tmp_path / "cell.toml", tmp_path / "model.json")


def source(place, name):
    return place.folder / "tree" / name / name


def shared_point(place, name):
    """Write a job that comes to one point from two sides."""
    job = drawn(load_cell(place.cell), 5, 1)
    q = job.moves[0].q + np.deg2rad(5.0)
    moves = [
        NeutralMove(Motion.LINEAR, at, name=point)
        for turn in (-4.0, 4.0)
        for at, point in ((q + np.deg2rad(turn), ""), (q, "shared"))
    ]
    return LANGUAGES[name](replace(job, moves=(job.moves[0], *moves)))


def out(place, name):
    """Compensate a job; return the output."""
    made = place.folder / "made" / name
    made.parent.mkdir(exist_ok=True)
    assert place.compensate(source(place, name), "-o", made).exit_code in (0, 1)
    return made


def batch(place):
    given = ["--cell", place.cell, "--model", place.model, "--jobs", "1"]
    return cli("batch", place.folder / "tree", place.folder / "new", *given)


def survey(place, to):
    return cli("survey", "--cell", place.cell, "--poses", "40", "-o", to)


def run(command, place, name):
    """Run the command of a cell."""
    given, to = source(place, name), place.folder / f"out{Path(name).suffix}"
    pair = ["--report", place.folder / "r.json", "--report", place.folder / "r.html"]
    match command:
        case "compensate":
            return place.compensate(given, "-o", to)
        case "compensate - (standard input)":
            return place.compensate("-", stdin=given.read_bytes())
        case "compensate --report":
            return place.compensate(given, "-o", to, *pair)
        case "compensate --orientation":
            return place.compensate(given, "-o", to, "--orientation")
        case "compensate --shared-points clone":
            files = shared_point(place, name)
            shared, *_ = (place.put(part, data) for part, data in files.items())
            return place.compensate(shared, "-o", to, "--shared-points", "clone")
        case "compensate --path-tolerance":
            return place.compensate(given, "-o", to, "--path-tolerance", "0.1")
        case "compensate --set compensation.reapproach=true":
            return place.compensate(
                given, "-o", to, "--set", "compensation.reapproach=true"
            )
        case "compensate --variables":
            values = place.put("v.lsv", "--$$\r\n")
            return place.compensate(given, "-o", to, "--variables", values)
        case "compensate without absolute_accuracy":
            place.cell.write_text(place.cell.read_text().replace(SAID, ""))
            return place.compensate(given, "-o", to)
        case "diff":
            return cli("diff", given, out(place, name))
        case "explain":
            return cli("explain", given, "--cell", place.cell, "--model", place.model)
        case "restore":
            return cli("restore", out(place, name), "-o", to)
        case "check":
            assert batch(place).exit_code in (0, 1)
            return cli("check", place.folder / "new", "--model", place.model)
        case "batch (one tree for all)":
            return batch(place)
        case "simulate":
            return cli("simulate", given, "--cell", place.cell, "-o", to)
        case "survey":
            return survey(place, to)
        case "fit --program":
            assert survey(place, to).exit_code == 0
            rows = place.folder / "rows.csv"
            cli("simulate", to, "--cell", place.cell, *ARM, "-o", rows)
            model = place.folder / "new.json"
            few = ("--effects", "geometry,backlash", "-o", model)
            return cli("fit", rows, "--program", to, "--cell", place.cell, *few)
        case "report":
            place.compensate(given, "-o", to, *pair)
            return cli("report", pair[1], "-o", place.folder / "page.html")
    raise AssertionError(command)


@pytest.mark.parametrize(("command", "language", "said"), cells())
def test_a_cell_of_the_table(place, command, language, said):
    name = NAMES[language]
    found = run(command, place, name)
    if said == "yes":
        assert found.exit_code in (0, 1), found.output
    else:
        assert found.exit_code == 2
        assert said in re.sub(r"\s+", " ", found.stderr)


def test_a_restored_module_is_what_it_was(place):
    name = NAMES["RAPID"]
    run("restore", place, name)
    assert (place.folder / "out.mod").read_bytes() == source(place, name).read_bytes()


def test_the_filter_writes_what_the_file_has(place):
    name = NAMES["RAPID"]
    piped = run("compensate - (standard input)", place, name)
    assert piped.stdout_bytes == out(place, name).read_bytes()


def test_a_batch_joins_the_modules_of_a_task(place):
    job = source(place, NAMES["RAPID"])
    lines = job.read_text().splitlines(keepends=True)
    points = [line for line in lines if "robtarget p" in line]
    job.write_text("".join(line for line in lines if line not in points))
    never = 'PROC never()\nTPWrite "x";\nENDPROC\n'
    job.with_name("points.mod").write_text(
        "MODULE points\n" + "".join(points) + never + "ENDMODULE\n"
    )
    assert batch(place).exit_code in (0, 1)
    made = place.folder / "new" / job.parent.name / "points.mod"
    assert points and b"MODULE points\n! postproc" in made.read_bytes()


def test_the_stamp_of_a_module_with_a_header_stands_inside(place):
    job, header = source(place, NAMES["RAPID"]), b"%%%\n VERSION:1\n%%%\n"
    job.write_bytes(header + job.read_bytes())
    given = job.read_bytes()
    made = out(place, NAMES["RAPID"])
    assert made.read_bytes().startswith(header + b"MODULE job\n! postproc ")
    again = place.compensate(made, "-o", place.folder / "again.mod")
    assert again.exit_code == 2 and "postproc" in again.stderr
    told = cli("diff", job, made).output
    assert "lines with other numbers" in told and "other text" not in told
    assert cli("restore", made, "-o", place.folder / "back.mod").exit_code == 0
    assert (place.folder / "back.mod").read_bytes() == given
    assert batch(place).exit_code in (0, 1)
    checked = cli("check", place.folder / "new", "--model", place.model)
    assert checked.exit_code == 0 and "0 findings" in checked.output


def test_jobs_of_an_archive_share_a_data_list(place):
    """``$config.dat`` is read for every job, and written by none."""
    folder, system = place.folder / "tree/R1/Program", place.folder / "tree/R1/System"
    shutil.move(source(place, NAMES["KRL"]).parent, folder)
    system.mkdir()
    job = folder / NAMES["KRL"]
    text = job.read_text()
    tool = re.search(r"(?m)^\$TOOL=(.*)$", text)
    job.write_text(text.replace(tool[0], "$TOOL=TOOL_DATA[1]"))
    for suffix in (".src", ".dat"):
        shutil.copy(job.with_suffix(suffix), folder / f"other{suffix}")
    shared = system / "$config.dat"
    shared.write_text(f"DEFDAT $CONFIG\nTOOL_DATA[1]={tool[1]}\nENDDAT\n")
    made = place.folder / "out.src"
    assert place.compensate(job, "-o", made).exit_code in (0, 1)
    assert "lines with other numbers" in cli("diff", job, made).output
    assert batch(place).exit_code in (0, 1)
    new = place.folder / "new/R1"
    assert (new / "Program/job.src").read_bytes() == made.read_bytes()
    assert b"; postproc" in (new / "Program/other.dat").read_bytes()
    assert (new / "System/$config.dat").read_bytes() == shared.read_bytes()
    checked = cli("check", place.folder / "new", "--model", place.model)
    assert checked.exit_code == 0 and "0 findings" in checked.output


def named_points(place):
    """Write a KRL job whose points all stand in its data list; return its source."""
    job = drawn(load_cell(place.cell), 5, 6)
    moves = [
        replace(move, name=f"n{k}", in_joints=False, via=None, motion=Motion.JOINT)
        for k, move in enumerate(job.moves)
    ]
    folder = place.folder / "named"
    folder.mkdir()
    for part, data in LANGUAGES["job.src"](replace(job, moves=moves)).items():
        (folder / part).write_bytes(data)
    return folder / "job.src"


def test_the_output_of_a_job_is_read_with_its_changed_data_list(place):
    """What was changed lies in the data list alone; the source is as it was."""
    job, made = named_points(place), place.folder / "made/job.src"
    made.parent.mkdir()
    assert place.compensate(job, "-o", made).exit_code == 0
    assert made.read_bytes() == job.read_bytes()
    changed = made.with_suffix(".dat")
    assert changed.read_bytes() != job.with_suffix(".dat").read_bytes()
    means = []
    for run_ in (job, made):
        given = ("--cell", place.cell, "--reference", job, *ARM, "--report", "-")
        found = cli("simulate", run_, *given, "-o", place.folder / "m.csv")
        means.append(json.loads(found.stdout)["true_error"]["mean_mm"])
    assert means[1] < 0.1 * means[0]
    again = place.compensate(made, "-o", place.folder / "again.src")
    assert again.exit_code == 2 and "job.dat:1: is compensated already" in again.stderr
    told = cli("restore", made)
    assert told.exit_code == 2 and "has a record of its own" in told.stderr
    assert cli("restore", changed).exit_code == 0
    assert changed.read_bytes() == job.with_suffix(".dat").read_bytes()
