"""A base of the cell that the joints and poses of a program contradict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.compensation.compensate import compensate
from postproc.compensation.findings.base_frame_check import check_base
from postproc.compensation.program import read_program
from postproc.compensation.program_files import name_files
from postproc.robot.pose import pose_from_record, record_from_pose
from tests.bench.made import drilling, handling, milling, spot
from tests.conftest import ROOT

SPREAD = 40.0  # [mm] between an approach in joints and its target


def made(cell, base, n=4, seed=1, away=SPREAD):
    """Write a program as it is made where the arm stands on some base.

    Each target is approached by a JOINT move some way off, as posts write it.
    """
    rng = np.random.default_rng(seed)
    lines = []
    for _ in range(n):
        middle = np.array([0.0, 10.0, -95.0, 20.0, 50.0, 30.0])
        q = np.deg2rad(middle + rng.uniform(-20, 20, 6))
        pose = base @ cell.arm.flange(q[None])[0] @ cell.tool.pose
        pose[:3, 3] += rng.normal(size=3) * away / 1000
        numbers = ", ".join(f"{v:.4f}" for v in record_from_pose(pose))
        lines.append(f"MOVE TO {{{', '.join(f'{v:.5f}' for v in np.rad2deg(q))}}}")
        lines.append(f"MOVE LINEAR TO POS({numbers}, '')")
    head = "PROGRAM job\nBEGIN\n$UFRAME := POS(0, 0, 0, 0, 0, 0, '')\n"
    return (head + "\n".join(lines) + "\nEND job\n").encode()


def turned(degrees, z=0.0):
    return pose_from_record(np.array([0.0, 0.0, z, degrees, 0.0, 0.0]))


def standing(cell, base):
    record = tuple(map(float, record_from_pose(base)))
    return replace(cell, base=replace(cell.base, pose=base, record=record))


def findings(source, cell):
    return check_base(read_program({"job.pdl": source}, cell).visits, cell)


@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.parametrize(("degrees", "z"), [(90, 0), (90, 450), (180, 0), (-90, 0)])
def test_a_program_made_without_the_base_of_the_cell_is_told(job_cell, degrees, z, n):
    cell = standing(job_cell, turned(degrees, z))
    (found,) = findings(made(cell, np.eye(4), n), cell)
    assert (found.code, found.line) == ("base-frame-mismatch", 5)
    assert "identity" in found.message and f"{n} Cartesian" in found.message
    assert findings(made(cell, cell.base.pose, n), cell) == []


def test_a_base_that_is_missing_in_the_cell_is_told(job_cell):
    (found,) = findings(made(job_cell, turned(90)), job_cell)
    assert "turned by 90" in found.message


def test_a_program_that_sets_its_base_is_its_own_judge(job_cell):
    cell = standing(job_cell, turned(90))
    source = made(cell, np.eye(4))
    own = source.replace(b"BEGIN\n", b"BEGIN\n$BASE := POS(0, 0, 0, 0, 0, 0, '')\n")
    assert findings(source, cell) and findings(own, cell) == []


def test_approaches_from_far_away_tell_nothing(job_cell):
    for seed in range(20):
        source = made(job_cell, np.eye(4), seed=seed, away=1500.0)
        assert findings(source, job_cell) == []


def test_it_is_told_with_what_came_of_the_program(job_cell, job_model):
    cell = standing(job_cell, turned(90))
    outcome = compensate(made(cell, np.eye(4)), cell, job_model, name="job.pdl")
    assert "base-frame-mismatch" in {d.code for d in outcome.diagnostics}


def test_shipped_and_made_programs_do_not_contradict_their_cell(bench_cell):
    for path in sorted((ROOT / "programs").glob("*.pdl")):
        files = {path.name: path.read_bytes()}
        values = path.with_suffix(".lsv")
        if values.exists():
            files[values.name] = values.read_bytes()
        visits = read_program(files, bench_cell).visits
        assert check_base(visits, bench_cell) == []
    for one in (milling(200), drilling(200), spot(200), handling(200)):
        files = name_files(one.name, one.source, one.variables)
        visits = read_program(files, bench_cell).visits
        assert check_base(visits, bench_cell) == []
