"""Programs that pass by: pipes and devices as inputs and outputs, read once."""

from __future__ import annotations

import re
import stat
import subprocess
import sys

import pytest

from tests.pipes import feed, made_pipe, reading
from tests.written import FIRST, LISTED, POSE, cli, entry, program

TOOL = [sys.executable, "-c", "from postproc.cli import main; main()"]
VALUED = program(FIRST, "MOVE LINEAR TO a", declared="a : XTNDPOS")


def test_the_place_of_a_program_may_be_a_device(desk, device):
    source = desk.put("job.pdl", program(FIRST, POSE))
    found = desk.compensate(source, "-o", device)
    assert found.exit_code == 0, found.stderr
    assert stat.S_ISCHR(device.stat().st_mode)
    assert desk.names() == {"job.pdl"}
    assert not list(device.parent.glob(f"{device.name}.*"))


def test_a_program_through_pipes_comes_out_as_from_files(desk, pipe):
    text = program(FIRST, POSE)
    desk.compensate(desk.put("job.pdl", text), "-o", desk.folder / "out.pdl")
    want = (desk.folder / "out.pdl").read_bytes()
    feed(pipe, text)
    found = desk.compensate(pipe)
    assert found.exit_code == 0, found.stderr
    assert found.stdout_bytes == want
    with reading(pipe) as got:
        assert desk.compensate(desk.folder / "job.pdl", "-o", pipe).exit_code == 0
    assert got == [want]
    assert desk.names() == {"job.pdl", "out.pdl", "out.pdl.postproc.json", "pipe"}


def test_a_command_of_the_shell_as_input(desk):
    desk.put("job.pdl", program(FIRST, POSE))
    tool = " ".join(f"'{word}'" for word in TOOL)
    given = f"--cell {desk.cell} --model {desk.model}"
    script = f"{tool} compensate <(cat job.pdl) {given}"
    done = subprocess.run(
        ["bash", "-c", script], cwd=desk.folder, capture_output=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"-- postproc")
    assert desk.names() == {"job.pdl"}


@pytest.mark.parametrize("text", [program(FIRST, POSE), b"PROGRAM x\0"])
def test_explain_reads_a_pipe_once(desk, pipe, text):
    feed(pipe, text)
    found = cli("explain", pipe, "--cell", desk.cell)
    assert found.exit_code == (2 if b"\0" in text else 0)
    assert "stdin.pdl" in found.stderr or "2 visits" in found.stdout


def test_diff_reads_pipes_once(desk, tmp_path):
    pipes = [tmp_path / "a", tmp_path / "b"]
    for path, text in zip(pipes, (POSE, POSE.replace("100.0", "101.0")), strict=True):
        made_pipe(path)
        feed(path, program(FIRST, text))
    found = cli("diff", *pipes)
    assert found.exit_code == 1 and "max 1.000 mm" in found.stdout


def test_values_of_a_program_that_goes_through_a_pipe_need_a_place(desk, pipe):
    source, values = (
        desk.put("job.pdl", VALUED),
        desk.put("job.lsv", LISTED + entry("a")),
    )
    found = desk.compensate(source, "-o", pipe)
    assert found.exit_code == 2
    assert re.search(r"job\.lsv: changes too, .*--variables-out FILE", found.stderr)
    assert desk.names() == {"job.pdl", "job.lsv", "pipe"}
    assert values.read_bytes() == (LISTED + entry("a")).encode()
