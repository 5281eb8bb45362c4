"""Surveys that are not what they say: file, cure and exit code of postproc fit."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest

from tests.written import cli

JOINTS = [f"q{j}_deg" for j in range(1, 7)]
SIDES = [f"lambda{j}" for j in range(1, 7)]
XYZ = ["x_mm", "y_mm", "z_mm"]
BASE = ("--effects", "geometry,backlash")


@pytest.fixture
def survey(job_folder):
    """The rows of the job's survey as numbers by column."""
    with (job_folder / "survey.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(r[name]) for r in rows]) for name in rows[0]}


@pytest.fixture
def fit(desk):
    """Write a survey and fit it through the command line."""

    def run(columns, *options, name="s.csv", delimiter=",", decimal="."):
        path = desk.folder / name
        lines = [delimiter.join(columns)]
        for row in zip(*columns.values(), strict=True):
            cells = (f"{v:.6f}".rstrip("0").rstrip(".") for v in row)
            lines.append(delimiter.join(c.replace(".", decimal) for c in cells))
        path.write_text("\n".join(lines) + "\n")
        out = desk.folder / "m.json"
        return cli("fit", path, "--cell", desk.cell, "-o", out, *BASE, *options)

    return run


def block(survey, names):
    return np.stack([survey[n] for n in names], axis=1)


def put(survey, names, values):
    return {**survey, **dict(zip(names, values.T, strict=True))}


def without(survey, *names):
    return {k: v for k, v in survey.items() if k not in names}


def tracker_frame(survey):
    c, s = np.cos(2.0), np.sin(2.0)
    turned = (block(survey, XYZ) - [4000.0, -3000.0, 1500.0]) @ np.array(
        [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    )
    return put(survey, XYZ, turned)


def some_in_metres(survey):
    xyz = block(survey, XYZ)
    xyz[40:70] /= 1000.0
    return put(survey, XYZ, xyz)


def swapped(survey):
    return {**survey, "q4_deg": survey["q6_deg"], "q6_deg": survey["q4_deg"]}


WITHOUT_TOOLS = ("tool_id", "tool_x_mm", "tool_y_mm", "tool_z_mm")
WRONG = {
    "metres": (
        lambda s: put(s, XYZ, block(s, XYZ) / 1e3),
        r"look like metres: write millimetres",
    ),
    "some metres": (
        some_in_metres,
        r":42: 30 of 300 rows look like metres\. The others are in millimetres: write",
    ),
    "radians": (
        lambda s: put(s, JOINTS, np.radians(block(s, JOINTS))),
        r"joint angles look like radians: write degrees",
    ),
    "order": (swapped, r"Joints 4 and 6 look swapped: correct the columns"),
    "sign": (
        lambda s: {**s, "q3_deg": -s["q3_deg"]},
        r"Joint 3 looks like it has the other sign",
    ),
    "frame": (
        tracker_frame,
        r"look like the tracker's frame: use --set measurements.frame=tracker",
    ),
    "tools": (
        lambda s: without(s, *WITHOUT_TOOLS),
        r":3: the rows were measured with 3 tools \(first seen in rows 1, 2, 3\).*"
        r"Add a column tool_id and the points to \[survey\]",
    ),
    "plane": (
        lambda s: put(s, ["q1_deg", "q4_deg", "q6_deg"], np.zeros((300, 3))),
        r"determine \d+ of \d+ independent geometric parameters\. Measure more poses",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_survey_that_is_not_what_it_says_is_refused(desk, survey, fit, name):
    spoil, said = WRONG[name]
    found = fit(spoil(survey))
    assert found.exit_code == 2, found.stdout
    assert re.search(r"s\.csv.*" + said, found.stderr), found.stderr
    assert found.stdout == "" and desk.names() == {"s.csv"}


@pytest.mark.parametrize(
    ("name", "said"), [("some metres", "rows look like metres"), ("tools", "tools")]
)
def test_mixed_rows_in_the_tracker_s_frame(survey, fit, name, said):
    seen = tracker_frame(survey)
    found = fit(WRONG[name][0](seen), "--set", "measurements.frame=tracker")
    assert found.exit_code == 2 and said in found.stderr, found.stderr


def test_sorted_rows_have_lost_their_directions(survey, fit):
    order = np.argsort(survey["q2_deg"])
    rows = {k: v[order] for k, v in without(survey, *SIDES, "time_s").items()}
    found = fit(rows)
    assert found.exit_code == 0
    assert re.search(
        r"warning: .*s\.csv: no lambda columns.*sorted by q2_deg, so that the order of "
        "visits.*are lost.*Use the file as it was measured",
        found.stdout,
    )
    bare = fit(without(survey, *SIDES, "time_s"))
    assert "If the rows were sorted" in bare.stdout
    assert "no lambda" not in fit(survey).stdout


def test_rows_from_one_side_leave_the_backlash_unseen(survey, fit):
    found = fit(put(survey, SIDES, np.ones((300, 6))))
    assert found.exit_code == 0
    (told,) = re.findall("not determined by the rows, at the prior: (.*)", found.stdout)
    (joints,) = re.findall("backlash ([b1-6 ]+)", told)
    assert {"b1", "b2", "b3", "b4", "b5"} <= set(joints.split())


def test_options_say_how_a_file_is_to_be_read(desk, survey, fit):
    names = {n: f"c{k}" for k, n in enumerate(survey)}
    form = desk.put(
        "map.toml", "[columns]\n" + "".join(f'{n} = "{c}"\n' for n, c in names.items())
    )
    renamed = {names[n]: v for n, v in survey.items()}
    how = ("--set", f"measurements.columns={form}",
           "--set", "measurements.delimiter=|",
           "--set", "measurements.decimal=,")  # fmt: skip
    found = fit(renamed, *how, delimiter="|", decimal=",")
    assert found.exit_code == 0, found.stderr
    mapped = json.loads((desk.folder / "m.json").read_bytes())
    assert fit(survey).exit_code == 0
    plain = json.loads((desk.folder / "m.json").read_bytes())
    assert mapped["parameters"] == plain["parameters"]
    other = ("--set", "measurements.delimiter=;")
    found = fit(renamed, *how[:2], *other, delimiter="|", decimal=",")
    assert found.exit_code == 2
    assert re.search(r"s\.csv:1: column c0, .* is missing", found.stderr)
    found = fit(survey, "--set", "measurements.decimal=x")
    assert found.exit_code == 2 and "'.' or ','" in found.stderr


def test_lambda_by_which_links_run_ahead_is_refused_until_its_sign_is_stated(
    survey, fit
):
    other = put(survey, SIDES, -block(survey, SIDES))
    refused = fit(other)
    assert refused.exit_code == 2 and "lambda_sign=-1" in refused.stderr
    turned = fit(other, "--set", "measurements.lambda_sign=-1")
    assert turned.exit_code == 0
    parts = [
        re.search(r"after fit mean [\d.]+", x.stdout) for x in (turned, fit(survey))
    ]
    assert parts[0] and parts[1] and parts[0][0] == parts[1][0]
    assert fit(other, "--set", "measurements.lambda_sign=1").exit_code == 0
