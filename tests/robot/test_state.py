"""Payload and temperature: compensated as declared, refused where not surveyed."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from tests.conftest import CELL
from tests.written import FIRST, POSE, cli, program

EFFECTS = "payload,thermal"
ARM = "--set", "simulation.seed=3", "--set", f"simulation.effects={EFFECTS}"


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A survey at two payloads along a warm-up, and the model fitted to it."""
    folder = tmp_path_factory.mktemp("state")
    (folder / "cell.toml").write_text(CELL)
    (folder / "loaded.toml").write_text(declared(60, 26))
    rng, n = np.random.default_rng(0), 260
    low, high = [-90, -45, -170, -150, -110, -150], [90, 60, -40, 150, 110, 150]
    joints = ",".join(f"q{j}_deg" for j in range(1, 7))
    sides = ",".join(f"lambda{j}" for j in range(1, 7))
    lines = [f"id,{joints},{sides},payload_kg,temperature_c,tool_id"]
    for k in range(n):
        q = ",".join(f"{v:.4f}" for v in rng.uniform(low, high))
        side = ",".join(str(s) for s in rng.choice([-1, 1], 6))
        state = f"{120 * (k // 26 % 2)},{20 + 12 * (1 - np.exp(-3 * k / n)):.2f}"
        lines.append(f"{k + 1},{q},{side},{state},{k % 3}")
    (folder / "rows.csv").write_text("\n".join(lines) + "\n")
    cell = ("--cell", folder / "loaded.toml")
    assert run("simulate", folder / "rows.csv", *cell, *ARM,
               "-o", folder / "s.csv") == 0  # fmt: skip
    assert run("fit", folder / "s.csv", *cell, "-o", folder / "m.json", "--effects",
               f"geometry,backlash,backlash_profile,{EFFECTS}") == 0  # fmt: skip
    (folder / "job.pdl").write_bytes(program(FIRST, POSE))
    return folder


def run(*arguments):
    found = cli(*arguments)
    assert found.exit_code in (0, 1), found.stderr
    return found.exit_code


def declared(payload=None, temperature=None):
    """Write a cell that declares a payload and a temperature."""
    text = CELL
    if payload is not None:
        text += f"[payload]\nmass_kg = {payload}\ncom_mm = [0.0, 0.0, 150.0]\n"
    if temperature is not None:
        text += f"[environment]\ntemperature_c = {temperature}\n"
    return text


def compensate(folder, payload, temperature):
    """Compensate the job in a declared state; the report's rows."""
    cell, report = folder / "now.toml", folder / "r.json"
    cell.write_text(declared(payload, temperature))
    run("compensate", folder / "job.pdl", "--cell", cell, "--model",
        folder / "m.json", "-o", folder / "out.pdl", "--report", report)  # fmt: skip
    return json.loads(report.read_bytes())["targets"]


@pytest.mark.parametrize(("payload", "temperature"), [(0, 21), (120, 31), (60, 26)])
def test_a_job_is_compensated_for_the_state_that_the_cell_declares(
    campaign, payload, temperature
):
    rows = compensate(campaign, payload, temperature)
    assert [row["status"] for row in rows] == ["corrected", "corrected"]
    found = cli("simulate", campaign / "out.pdl", "--cell", campaign / "now.toml",
                "--reference", campaign / "job.pdl", *ARM,
                "--report", "-")  # fmt: skip
    error = json.loads(found.stdout)["true_error"]
    # Where the arm was before its first move is not known: its backlash stays.
    later = (error["mean_mm"] * error["n"] - error["max_mm"]) / (error["n"] - 1)
    assert later < 0.03


def test_another_state_is_another_correction(campaign):
    empty, full = (compensate(campaign, p, 26) for p in (0, 120))
    cold, warm = (compensate(campaign, 60, t) for t in (21, 31))
    for a, b in ((empty, full), (cold, warm)):
        moved = np.subtract(a[1]["correction_mm"], b[1]["correction_mm"])
        assert np.linalg.norm(moved) > 0.05


@pytest.mark.parametrize(
    ("payload", "temperature", "why"),
    [
        (60, 45, r"temperature is outside the surveyed 20.* to 3\d.* deg C"),
        (None, 26, r"payload is not known, and the model needs it"),
        (60, None, r"temperature is not known, and the model needs it"),
    ],
)
def test_a_state_that_was_not_surveyed_is_refused(campaign, payload, temperature, why):
    for row in compensate(campaign, payload, temperature):
        assert row["status"] == "rejected" and re.search(why, row["reason"]), row
        assert row["corrected"] == row["original"]


def test_a_load_that_was_not_surveyed_costs_certainty_and_is_bounded_by_the_cell(
    campaign,
):
    known, heavy = (compensate(campaign, p, 26) for p in (120, 200))
    assert [row["status"] for row in heavy] == ["corrected", "corrected"]
    for less, more in zip(known, heavy, strict=True):
        assert np.linalg.norm(more["std_error_mm"]) > np.linalg.norm(
            less["std_error_mm"]
        )
    cell = declared(200, 26).replace("[limits]", "[limits]\npayload_mm = 1e-6")
    if "[limits]" not in cell:
        cell += "[limits]\npayload_mm = 1e-6\n"
    (campaign / "bounded.toml").write_text(cell)
    run("compensate", campaign / "job.pdl", "--cell", campaign / "bounded.toml",
        "--model", campaign / "m.json", "-o", campaign / "b.pdl",
        "--report", campaign / "b.json")  # fmt: skip
    for row in json.loads((campaign / "b.json").read_bytes())["targets"]:
        assert row["status"] == "rejected" and "load" in row["reason"], row
        assert row["corrected"] == row["original"]
