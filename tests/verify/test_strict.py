"""A strict run that a second opinion disagrees with."""

from __future__ import annotations

import shutil

import pytest
from typer.testing import CliRunner

from postproc.cli.commands import app
from postproc.verify import directions
from tests.verify.judged import PROGRAMS


@pytest.mark.parametrize("strict", [(), ("--strict",)])
def test_the_message_names_the_disagreement(
    strict, tmp_path, bench_model, monkeypatch
) -> None:
    monkeypatch.setattr(directions, "END_RAD", -1.0)  # all ends are beyond it
    bench_model.save(tmp_path / "model.json")
    asking = "\n[verify]\nsecond_opinion = true\n"
    text = (PROGRAMS / "cell.toml").read_text()
    (tmp_path / "cell.toml").write_text(text + asking)
    for name in ("spot.pdl", "spot.lsv"):
        shutil.copy(PROGRAMS / name, tmp_path)
    out = tmp_path / "out.pdl"
    done = CliRunner().invoke(app, [
        "compensate", str(tmp_path / "spot.pdl"), "--cell", str(tmp_path / "cell.toml"),
        "--model", str(tmp_path / "model.json"), "-o", str(out), *strict,
    ])  # fmt: skip
    assert done.exit_code == (2 if strict else 1), done.stderr
    assert out.exists() == (not strict)
    assert ("--strict: the second opinion disagrees" in done.stderr) == bool(strict)
    assert "targets are not corrected" not in done.stderr
