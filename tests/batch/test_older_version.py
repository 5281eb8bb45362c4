"""A tree that version 0.1.0 compensated: restored, compared, checked and resumed.

tests/cases/tree-0.1.0.zip holds, in the three languages, sources (`src`), what
`batch --plan plan.toml --log log.jsonl` made of them (`dst`, with its records), its
log, cells and models, and what `diff --json` and `check --json` of that version
printed. It is never made again.
"""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from pathlib import Path

import pytest

from postproc.compensation.outcome import Status
from postproc.model.model import load_model
from tests.plant import contents
from tests.written import cli

ARCHIVE = Path(__file__).parents[1] / "cases" / "tree-0.1.0.zip"
STATUSES = ("safe", "unsafe", "display", "guarded", "unchanged")  # as it named them
SUFFIX, LOG = ".postproc.json", "dst.batch.jsonl"
CHANGED = (
    "abb/taught/job.mod",  # whose comment TAUGHT holds for its statement since
    "abb/search/job.mod",  # which goes on with ConfL Off where the search ended
    "abb/shared/job.mod",  # whose arrivals have one correction since
    "pdl/line001/weld.pdl",
)
STAMP = re.compile(rb"(?m)^[ \t]*(?:--|!|;) postproc \S+ model=[^\r\n]*\r?\n")


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """The tree in a folder of its own, in which commands run."""
    with zipfile.ZipFile(ARCHIVE) as archive:
        archive.extractall(tmp_path)
    (tmp_path / "log.jsonl").rename(tmp_path / LOG)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("postproc.batch.plan.__version__", "0.1.0")
    return tmp_path


def resume(*options: str) -> int:
    given = ("--plan", "plan.toml", "--jobs", 1)
    return cli("batch", "src", "dst", *given, "--resume", *options).exit_code


def test_every_record_gives_its_sources_back(tree):
    for record in sorted((tree / "dst").rglob("*" + SUFFIX)):
        if json.loads(record.read_text())["files"]:
            assert cli("restore", str(record).removesuffix(SUFFIX)).exit_code == 0
        record.unlink()
    assert contents(tree / "dst") == contents(tree / "src")


def test_diff_reports_the_same_targets(tree):
    names = {old: Status(k).name.lower() for k, old in enumerate(STATUSES)}
    for place, old in json.loads((tree / "diffs.json").read_text()).items():
        found = cli("diff", f"src/{place}", f"dst/{place}", "--report", "-")
        assert found.exit_code == old["exit"]
        new = json.loads(found.stdout)
        assert new["counts"] == {names[k]: v for k, v in old["counts"].items()}
        assert as_now(new["rows"], names) == as_now(old["rows"], names)
        left = new.get("left", new.get("uncorrected"))
        assert as_now(left, names) == as_now(old["left"], names)


def as_now(rows: list[dict], names: dict[str, str]) -> list[dict]:
    """Return rows of a difference in the keys and statuses of today, without codes."""
    return [
        {
            **{k: v for k, v in row.items() if k not in ("why", "reason", "code")},
            "status": names.get(row["status"], row["status"]),
            "visits": {names.get(k, k): v for k, v in row["visits"].items()},
            "reason": row.get("why", row.get("reason")),
        }
        for row in rows
    ]


def test_check_finds_the_same_files_and_lines(tree):
    old = json.loads((tree / "check.json").read_text())
    found = cli("check", "dst", "--source", "src", "--report", "-")
    assert found.exit_code == 1
    new = json.loads(found.stdout)
    assert new["programs"] == old["programs"]
    for a, b in zip(old["findings"], new["findings"], strict=True):
        assert a["place"] == b["place"]
        assert a["message"].split("; ")[1:] == b["message"].split("; ")[1:]


def test_check_knows_by_which_model_a_program_was_made(tree):
    found = cli("check", "dst", "--model", "abb/model.json", "--report", "-")
    others = json.loads(found.stdout)["findings"]
    older = {f["place"] for f in others if f["code"] == "older-model"}
    records = {p.removesuffix(SUFFIX) for p in contents(tree / "dst") if SUFFIX in p}
    assert older == {place for place in records if not place.startswith("abb/")}


def test_a_run_resumes_without_touching_a_file(tree):
    before = contents(tree / "dst")
    written = {p: p.stat().st_mtime_ns for p in (tree / "dst").rglob("*")}
    assert resume() == 1
    assert contents(tree / "dst") == before
    assert {p: p.stat().st_mtime_ns for p in written} == written


def test_a_run_that_was_cut_short_makes_the_same_programs(tree):
    before = programs_of(tree / "dst")
    log = (tree / LOG).read_text().splitlines(keepends=True)
    (tree / LOG).write_text("".join(log[:8]) + log[8][:40])
    shutil.rmtree(tree / "dst" / "kuka")
    shutil.rmtree(tree / "dst" / "abb")
    assert resume() == 1
    assert programs_of(tree / "dst") == before


def programs_of(root: Path) -> dict[str, bytes]:
    """Return the files of a tree but its records, without their stamps.

    That version stamped programs in which nothing was corrected, too. Those that are
    compensated otherwise today are not among them.
    """
    return {
        place: STAMP.sub(b"", (root / place).read_bytes(), count=1)
        for place in contents(root)
        if not place.endswith(SUFFIX) and place not in CHANGED
    }


@pytest.mark.parametrize("name", ["abb", "desk", "kuka"])
def test_its_models_keep_their_ids(tree, name):
    path = tree / name / "model.json"
    assert load_model(path).id == json.loads(path.read_text())["id"]


def test_its_models_tell_their_history(tree):
    found = cli("history", "diagnosed.json")
    assert found.exit_code == 0
    assert "transmission of joint 5 by joint 5" in found.stdout
