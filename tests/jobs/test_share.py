"""The frozen jobs are what they were, run, and keep the share that is corrected."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from postproc.compensation.options import Options
from postproc.robot.cell import load_cell
from tests.jobs.share import HERE, LANGUAGES, count, counted, landed, main, pasted
from tests.slow import slow

JOBS = sorted(job for language in LANGUAGES for job in (HERE / language).glob("job*"))
# Counted lines, and those that are corrected, of RAPID with clones, at the least.
FLOORS = {
    "rapid/job01": (15, 13),
    "rapid/job07": (15, 15),
    "rapid/job25": (12, 11),
    "rapid/job38": (14, 14),
    "krl/job01": (15, 13),
    "krl/job05": (17, 15),
    "krl/job06": (40, 40),
    "krl/job22": (11, 7),
    "krl/job32": (14, 12),
    "krl/job34": (26, 24),
    "krl/job39": (42, 40),
}


def options_of(name: str) -> Options:
    """Return what a job is compensated with: points of RAPID can be cloned."""
    return Options(shared_points="clone" if name.startswith("rapid") else "mean")


def test_the_jobs_are_frozen():
    sums = dict(
        reversed(line.split(maxsplit=1))
        for line in (HERE / "SHA256SUMS").read_text("latin-1").splitlines()
    )
    sums = {name.lstrip("*").removeprefix("./"): value for name, value in sums.items()}
    files = {
        path.relative_to(HERE).as_posix(): path
        for job in JOBS
        for path in job.rglob("*")
        if path.is_file()
    }
    assert len(JOBS) == 80 and files.keys() <= sums.keys()
    for name, path in files.items():
        assert hashlib.sha256(path.read_bytes()).hexdigest() == sums[name], name


@pytest.mark.parametrize(
    ("every", "lines", "least"), [(5, 333, 280), *slow([(1, 566 + 671, 880)])]
)
def test_every_job_runs(every, lines, least):
    """Programs end with 0 or 1: nothing is refused, and something is corrected."""
    total = corrected = 0
    for job in JOBS[::every]:
        found = count(job)
        assert found.exit_codes and set(found.exit_codes) <= {0, 1}, job
        assert set(found.reasons) == set(counted(job))
        total, corrected = total + len(found.reasons), corrected + found.corrected
    assert total == lines and corrected >= least


@pytest.mark.parametrize("name", FLOORS)
def test_the_share_does_not_fall(name):
    lines, floor = FLOORS[name]
    found = count(HERE / name, options=options_of(name))
    assert len(found.reasons) == lines and found.corrected >= floor


@pytest.mark.parametrize("name", FLOORS)
def test_the_arm_lands_where_the_job_says(name):
    found = landed(HERE / name, options_of(name))
    assert found.sure.max(initial=0.0) <= 0.05
    if len(found.before):
        both = np.concatenate([found.sure, found.other])
        assert both.mean() < 0.3 * found.before.mean()


def test_what_messages_ask_for_is_pasted(tmp_path):
    job, clone = HERE / "rapid/job37", Options(shared_points="clone")
    cell = pasted(job, tmp_path / "cell.toml")
    assert load_cell(cell).aux == {1: "track"} != load_cell(job / "cell.toml").aux
    before, after = count(job, options=clone), count(job, cell, clone)
    assert after.corrected > before.corrected


def test_lines_to_home_positions_are_told_apart(capsys):
    main(["--language", "krl", "--jobs", "01"])
    told = capsys.readouterr().out
    assert "krl: 13 of 15 motion lines (86.7 %) are corrected" in told
    assert "  13 of the 13 (100.0 %) that go to no home position" in told
