"""Diagnosing files: frames, the chain of models, words and plots."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.calibration.diagnosis.files import (
    diagnose,
    from_tracker_frame,
    from_user_frame,
)
from postproc.calibration.fit import fit
from postproc.calibration.survey_files import read_measurements
from postproc.cli.loop import path_of_extension
from postproc.exceptions import OutputError
from postproc.model.effects import BASE_EFFECTS
from postproc.model.model import load_model
from postproc.report.diagnosis import history_json, history_text, tell
from postproc.report.plots import plot_diagnosis
from postproc.robot.cell import load_cell
from postproc.robot.pose import pose_from_record
from tests.calibration.planted import campaign, few_parts

CELL = """
[robot]
arm = "nj220-2.7"
[tool]
xyz_mm = [80.0, -40.0, 150.0]
[base]
xyz_mm = [100.0, 200.0, 300.0]
euler_zyz_deg = [10.0, 0.0, 0.0]
[uframe]
xyz_mm = [1600.0, -300.0, 900.0]
euler_zyz_deg = [30.0, 20.0, -10.0]
[tracker]
xyz_mm = [3000.0, -2000.0, 1500.0]
"""
HEADER = [
    "id",
    *(f"q{j}_deg" for j in range(1, 7)),
    *(f"lambda{j}" for j in range(1, 7)),
    "x_mm", "y_mm", "z_mm", "time_s", "temperature_c", "payload_kg", "speed_mm_s",
    *(f"travel{j}_deg" for j in range(1, 7)),
]  # fmt: skip


def write_rows(path: Path) -> None:
    """Write a campaign of an arm whose joint 6 is dragged along."""
    c = campaign(340, ("coupling",), 1.5, rows=300)
    s = c.states
    table = np.column_stack([
        np.degrees(s.q), s.direction, c.position * 1e3, s.time, s.temperature,
        s.payload, s.speed * 1e3, np.degrees(s.travel),
    ])  # fmt: skip
    lines = [",".join(HEADER)]
    lines += [
        f"{i + 1}," + ",".join(f"{x:.6f}" for x in row) for i, row in enumerate(table)
    ]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("diagnosing")
    (folder / "cell.toml").write_text(CELL)
    write_rows(folder / "rows.csv")
    cell = load_cell(folder / "cell.toml")
    made = fit(folder / "rows.csv", cell=cell, effects=BASE_EFFECTS)
    made.model.save(folder / "model.json")
    return folder


def test_files_in_model_and_words_out(job: Path, tmp_path: Path) -> None:
    for name in ("cell.toml", "rows.csv", "model.json"):
        shutil.copy(job / name, tmp_path)
    told: list[float] = []
    with few_parts():
        found = diagnose(
            tmp_path / "rows.csv",
            cell=tmp_path / "cell.toml",
            model=tmp_path / "model.json",
            progress=lambda stage, share: told.append(share),
        )
    assert found.to_frame()["effect"].tolist() == ["coupling"]
    assert told == sorted(told)
    assert 0 <= told[0] < told[-1] < 1
    written = path_of_extension(tmp_path / "model.json")
    found.save(written)
    better = load_model(written)
    assert better.id == found.model.id
    assert better.parent == load_model(tmp_path / "model.json").id
    text = tell(found.diagnosis)
    assert "verdict: effect" in text
    assert "coupling" in text
    chain = history_text(written)
    assert "coupling of joint" in chain
    assert better.id in chain
    assert json.loads(history_json(written))["id"] == better.id
    assert "fitted" in history_text(tmp_path / "model.json")

    plots = plot_diagnosis(found, tmp_path / "d.png")
    assert [p.name for p in plots] == [
        "d-residual.png", "d-periodogram.png", "d-finding1.png"
    ]  # fmt: skip
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in plots)
    with pytest.raises(OutputError):
        plot_diagnosis(found, tmp_path / "missing" / "d.png")


def test_positions_in_the_user_frame_are_converted(job: Path) -> None:
    cell = load_cell(job / "cell.toml")
    rows = read_measurements(job / "rows.csv", cell=cell)
    base = pose_from_record((100.0, 200.0, 300.0, 10.0, 0.0, 0.0))
    frame = pose_from_record((1600.0, -300.0, 900.0, 30.0, 20.0, -10.0))
    inside = np.linalg.inv(frame) @ base
    there = rows.position @ inside[:3, :3].T + inside[:3, 3]
    back = from_user_frame(replace(rows, position=there), cell)
    assert np.abs(back.position - rows.position).max() < 1e-12


def test_positions_in_the_tracker_frame_are_registered(job: Path) -> None:
    cell, model = load_cell(job / "cell.toml"), load_model(job / "model.json")
    rows = read_measurements(job / "rows.csv", cell=cell)
    turn = pose_from_record((-3000.0, 500.0, 200.0, 70.0, 5.0, 20.0))
    there = rows.position @ turn[:3, :3].T + turn[:3, 3]
    back, placed = from_tracker_frame(replace(rows, position=there), cell, model)
    assert np.abs(back.position - rows.position).max() < 1e-3
    assert np.linalg.inv(turn)[:3, 3] == pytest.approx(placed.tracker, abs=1e-3)
    assert back.states.tool == pytest.approx(rows.states.tool)
