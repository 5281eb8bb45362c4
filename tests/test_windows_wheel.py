"""What tries the Windows wheel: it skips in words, and sees a byte that differs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from shutil import which

import pytest

from tests.conftest import ROOT

SMOKE = ROOT / ".ci" / "smoke.py"


@pytest.mark.skipif(sys.platform == "win32", reason="a script of bash")
def test_without_wine_it_is_skipped_with_a_message(tmp_path: Path) -> None:
    for name in ("bash", "dirname"):
        (tmp_path / name).symlink_to(which(name) or name)
    done = subprocess.run(
        [str(tmp_path / "bash"), ROOT / ".ci" / "windows"],
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0
    assert "is not tried: no wine here (apt install wine)" in done.stdout


def written(folder: Path, program: bytes, parameter: float) -> Path:
    for part in ("single", "back", "tree"):
        (folder / part).mkdir(parents=True)
    (folder / "tree" / "job.pdl").write_bytes(program)
    fitted = {"parameters": {"theta1": [parameter, 0.5]}}
    (folder / "fitted.json").write_text(json.dumps(fitted))
    return folder


@pytest.mark.parametrize(
    ("program", "parameter", "code"),
    [(b"MOVE", 1.0, 0), (b"MOVE", 1.0 + 1e-12, 0), (b"MOVF", 1.0, 1), (b"MOVE", 2, 1)],
)
def test_a_byte_or_a_number_that_differs_is_seen(
    tmp_path: Path, program: bytes, parameter: float, code: int
) -> None:
    one = written(tmp_path / "linux", b"MOVE", 1.0)
    other = written(tmp_path / "windows", program, parameter)
    command = [sys.executable, SMOKE, "compare", one, other]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    assert ("differs: tree/job.pdl" in done.stdout) == (program != b"MOVE")
