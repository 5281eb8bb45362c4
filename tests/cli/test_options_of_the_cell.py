"""[compensation] and [measurements] of a cell hold for every command."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace

import pytest
from typer.testing import CliRunner

import postproc
from postproc.batch.plan import open_setup
from postproc.cli.click_classes import ENDED, GROUPS, OLD_OPTIONS
from postproc.cli.commands import app
from postproc.compensation.options import Options
from postproc.exceptions import CellError, PostprocError
from postproc.robot.cell import load_cell
from tests.written import cli, program

KEPT = ("--orientation", "--shared-points", "--path-tolerance")  # of compensate
PLACE = "p := POS(100.0, 200.0, 150.0, 0.0, 175.0, 0.0, '')"
HIGH = "MOVE JOINT TO {12.0, 20.0, -85.0, 30.0, 60.0, 45.0}"
LOW = "MOVE JOINT TO {-12.0, -8.0, -140.0, -40.0, 20.0, -60.0}"
TWICE = (PLACE, HIGH, "MOVE JOINT TO p", LOW, "MOVE JOINT TO p")

ALONE = ("--set", "verify.second_opinion=false")


def with_section(desk, text: str):
    """Return a cell file with a further section."""
    return desk.put("own.toml", f"{desk.cell.read_text()}\n{text}\n")


def test_old_options_name_the_new_one(desk):
    job = desk.put("job.pdl", program(*TWICE))
    for given, new in OLD_OPTIONS.items():
        command, _, old = given.rpartition(" ")
        found = cli("batch" if old in KEPT else command or "compensate", job, old)
        assert found.exit_code == 2
        assert f"{old} is called {new}" in " ".join(found.stderr.split())
    for given, instead in ENDED.items():
        command, _, old = given.rpartition(" ")
        found = cli(command or "compensate", job, old)
        said = f"{old} is no option any more: {instead}"
        assert found.exit_code == 2 and said in " ".join(found.stderr.split())
    assert not desk.names() - {"job.pdl"}


def test_every_command_is_in_one_group():
    listed = [name for names in GROUPS.values() for name in names]
    found = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"})
    assert sorted(listed) == sorted({*listed})
    text = found.stdout.partition("[ARGS]...")[2]
    assert found.exit_code == 0 and "..." not in text
    for one in (*app.registered_commands, *app.registered_groups):
        name = one.name or one.callback.__name__
        assert name in listed and f"  {name} " in found.stdout
    places = [found.stdout.index(f"\n{title}:") for title in GROUPS]
    assert places == sorted(places)


def test_the_help_of_compensate_fits_on_a_screen():
    found = CliRunner().invoke(app, ["compensate", "--help"], env={"COLUMNS": "80"})
    assert 24 <= len(found.stdout.splitlines()) <= 40


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("compensation.orientation", "Write SECTION.KEY=VALUE. Sections: comp"),
        ("limits.conflict_mm=1", "Write SECTION.KEY=VALUE. Sections: comp"),
        ("compensation.nosuch=1", "unknown key @ $.nosuch. Known here: orientation"),
        ("compensation.nosuch=none", "unknown key @ $.nosuch"),
        ("compensation.shared_points=all", "'mean', 'clone' or 'leave' @ $.shared_poi"),
        ("compensation.max_inserted=-1", "greater than or equal to 0 @ $.max_inserted"),
        ("compensation.path_tolerance_mm=nan", "$.path_tolerance_mm"),
        ("measurements.unit=feet", "'mm', 'm', 'inch' or 'ft' @ $.unit"),
    ],
)
def test_a_change_is_checked_like_the_cell(desk, change, said):
    job = desk.put("job.pdl", program(*TWICE))
    found = desk.compensate(job, "--set", change)
    assert found.exit_code == 2 and said in found.stderr
    assert f"--set {change}: " in found.stderr


def test_a_section_of_the_cell_is_checked(desk):
    for text, said in (
        ("[compensation]\nclone = true", r"unknown key @ \$.compensation.clone"),
        ("[measurements]\ndecimal = 'x'", r"\$.measurements.decimal"),
        ("[compensation]\norientation = 3", r"\$.compensation.orientation"),
    ):
        with pytest.raises(CellError, match=said):
            load_cell(with_section(desk, text))


def test_changes_go_before_the_cell_and_none_stands_for_the_default(desk):
    own = with_section(desk, "[compensation]\nmax_inserted = 7\norientation = true")
    asked = ("compensation.max_inserted=3", 'compensation.shared_points="clone"')
    found = load_cell(own, changes=asked).compensation
    assert (found.max_inserted, found.shared_points, found.orientation) == (
        3, "clone", True,
    )  # fmt: skip
    assert load_cell(own).compensation.max_inserted == 7
    back = load_cell(own, changes=["compensation.max_inserted=none"])
    assert back.compensation.max_inserted == 1_000


def test_a_state_and_a_virtual_arm_are_set_like_all_else(desk):
    asked = (
        "environment.temperature_c=31", "payload.mass_kg=12", "tracker.xyz_mm=[1,2,3]",
        "simulation.effects=thermal,compliance@2=0.8", "survey.mode=optimal",
    )  # fmt: skip
    plain, cell = load_cell(desk.cell), load_cell(desk.cell, changes=asked)
    assert (cell.temperature, cell.payload_mass) == (31.0, 12.0)
    assert cell.tracker.tolist() == [0.001, 0.002, 0.003]
    assert cell.file.simulation.effects == "thermal,compliance@2=0.8"
    assert cell.probes.tolist() == plain.probes.tolist()
    back = load_cell(desk.cell, changes=[*asked, "environment.temperature_c=none"])
    assert math.isnan(back.temperature)


def test_a_word_of_two_commands_is_named_for_each(desk):
    job = desk.put("job.pdl", program(*TWICE))
    place = desk.folder / "s.pdl"
    for command in (("survey", "-o", place), ("simulate", job)):
        found = cli(*command, "--cell", desk.cell, "--seed", 3)
        section = "survey" if command[0] == "survey" else "simulation"
        said = f"--seed is called --set {section}.seed=N"
        assert found.exit_code == 2 and said in " ".join(found.stderr.split())


def test_every_way_to_compensate_does_the_same(desk):
    """By the cell, by options, by --set, in a batch, and in Python."""
    (desk.folder / "src").mkdir()
    job = desk.put("src/job.pdl", program(*TWICE))
    text = "[compensation]\norientation = true\nshared_points = 'clone'"
    own = with_section(desk, text)
    asked = ("--orientation", "--shared-points", "clone")
    keys = ("--set", "compensation.orientation=true",
            "--set", "compensation.shared_points=clone")  # fmt: skip
    for name in "abc":
        (desk.folder / name).mkdir()
    places = {name: desk.folder / f"{name}/job.pdl" for name in ("a", "b", "c", "d")}
    model = ("--model", desk.model)
    plain = desk.folder / "plain.pdl"
    assert desk.compensate(job, "-o", plain).exit_code in (0, 1)
    cli("compensate", job, "--cell", own, *model, "-o", places["a"])
    desk.compensate(job, *asked, "-o", places["b"])
    desk.compensate(job, *keys, "-o", places["c"])
    cli("batch", job.parent, places["d"].parent, "--cell", own, *model, "--jobs", 1)
    written = {place.read_bytes() for place in places.values()}
    assert len(written) == 1 and plain.read_bytes() not in written
    records = [f"{place}.postproc.json" for place in places.values()]
    options = [json.loads(open(r).read())["options"] for r in records]
    assert options[1:] == options[:-1]
    assert options[0]["orientation"] and options[0]["shared_points"] == "clone"
    by_cell = postproc.compensate(job, own, desk.model)
    given = Options(orientation=True, shared_points="clone")
    by_options = postproc.compensate(job, desk.cell, desk.model, options=given)
    for outcome in (by_cell, by_options):
        assert {outcome.outputs["job.pdl"]} == written
    less = postproc.compensate(job, own, desk.model, options=Options(orientation=False))
    assert {less.outputs["job.pdl"]} != written


def test_explain_shows_what_compensate_writes(desk):
    job = desk.put("job.pdl", program(*TWICE))
    own = with_section(desk, "[compensation]\norientation = true")
    outcome = postproc.compensate(job, own, desk.model)
    found = postproc.explain(job, own, desk.model)
    assert (outcome.decisions.turn != 0).any()
    assert str(found) == str(
        postproc.explain(job, desk.cell, desk.model, options=Options(orientation=True))
    )


def test_points_of_several_moves_may_be_left(desk):
    """A point is left as it is, though its arrivals would agree."""
    job = desk.put("job.pdl", program(*TWICE))
    wide = desk.cell.read_text() + "\n[limits]\nconflict_mm = 5.0\n"
    cell = desk.put("wide.toml", wide)
    given = ("--cell", cell, "--model", desk.model, "-o", desk.folder / "o.pdl")
    mean = cli("compensate", job, *given)
    assert mean.exit_code == 0, mean.stderr
    left = cli("compensate", job, *given, "--shared-points", "leave")
    assert left.exit_code == 1
    assert "several moves go to this point (shared_points = leave)" in left.stderr
    assert " conflict" in left.stderr


def test_preloading_needs_a_tolerance(desk):
    cell = load_cell(desk.cell, changes=["compensation.preload_backlash=true"])
    with pytest.raises(PostprocError, match="--path-tolerance"):
        Options().within(cell)
    assert Options(path_tolerance_mm=0.1).within(cell).preload_backlash


def test_what_decides_is_in_the_digest_of_a_batch(desk):
    plain = open_setup(desk.cell, desk.model, Options())
    asked = open_setup(desk.cell, desk.model, Options(orientation=True))
    own = with_section(desk, "[compensation]\norientation = true")
    stated = open_setup(own, desk.model, Options())
    read = with_section(desk, "[measurements]\nunit = 'm'")
    assert plain.digest != asked.digest == stated.digest
    assert open_setup(read, desk.model, Options()).digest == plain.digest


def test_check_asks_by_the_cell(desk):
    (desk.folder / "src").mkdir()
    job = desk.put("src/job.pdl", program("spot(1, 2)", *TWICE))
    out = desk.folder / "dst"
    assert cli(
        "batch",
        job.parent,
        out,
        "--cell",
        desk.cell,
        "--model",
        desk.model,
        "--jobs",
        1,
    ).exit_code in (0, 1)
    own = with_section(desk, "[compensation]\nassume_motion = true")
    text = (desk.folder / "plan.toml").as_posix()
    desk.put("plan.toml", f"[[rule]]\npattern = '**'\ncell = '{own}'\n"
             f"model = '{desk.model}'\n")  # fmt: skip
    for asked, found in (
        ((), False),
        (("--cell", desk.cell), False),
        (("--cell", own), True),
        (("--plan", text), True),
    ):
        done = cli("check", out, *asked, "--allow-uncorrected", *ALONE)
        assert ("routine-assumed-motionless" in done.stderr) is found, asked
    bare = cli("check", out, "--set", "compensation.assume_motion=true")
    assert bare.exit_code == 2 and "Give --cell or --plan" in bare.stderr


def test_every_command_reads_measurements_as_the_cell_says(desk, job_folder):
    """A foreign header, semicolons and decimal commas."""
    rows = list(csv.reader(io.StringIO((job_folder / "survey.csv").read_text())))
    names = [f"c{k}" for k in range(len(rows[0]))]
    lines = [";".join(cell.replace(".", ",") for cell in row) for row in rows[1:]]
    data = desk.put("s.csv", "\n".join([";".join(names), *lines]) + "\n")
    pairs = zip(rows[0], names, strict=True)
    desk.put("map.toml", "[columns]\n" + "".join(f'{k} = "{v}"\n' for k, v in pairs))
    own = with_section(
        desk, "[measurements]\ncolumns = 'map.toml'\ndelimiter = ';'\ndecimal = ','"
    )
    model = desk.folder / "m.json"
    fitted = cli("fit", data, "--cell", own, "-o", model, "--effects", "geometry")
    assert fitted.exit_code == 0, fitted.stderr
    plain = cli("predict", job_folder / "survey.csv", "--cell", desk.cell,
                "--model", model)  # fmt: skip
    given = ("--cell", own, "--model", model)
    predicted = cli("predict", data, *given)
    assert predicted.exit_code == 0, predicted.stderr
    assert plain.stderr.partition(": ")[2] == predicted.stderr.partition(": ")[2]
    assert cli("fit", data, "--cell", desk.cell, "-o", model).exit_code == 2
    found = postproc.read_measurements(data, cell=own)
    assert len(found) == len(rows) - 1
    other = load_cell(own, changes=["measurements.frame=uframe"])
    with pytest.raises(PostprocError, match="only `diagnose`"):
        postproc.fit(data, cell=other)
    bare = replace(other, measurements=load_cell(desk.cell).measurements)
    with pytest.raises(PostprocError, match="column id, q1_deg"):
        postproc.read_measurements(data, cell=bare)
