"""With every message scrambled, statuses, codes and exit codes are the same."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import postproc
from tests.golden.case import Case
from tests.golden.cases import all_cases
from tests.golden.running import run_all

HERE = Path(__file__).parent
TREE = HERE.parents[1] / "tests" / "cases" / "tree-0.1.0.zip"
CHOSEN = (
    "shared/02", "corpus/calls-02", "krl/interrupt-still", "krl/relative", "rapid/if",
    "rapid/offset", "refused/no-record",
)  # fmt: skip
DECIDING = ("status", "code", "codes", "line", "exit", "visits")


def chosen() -> list[Case]:
    """Choose programs in three languages, and a tree of them."""
    return [*(c for c in all_cases() if c.name in CHOSEN), tree_case()]


def tree_case() -> Case:
    """Return a batch over the frozen tree, checks of it and of the tree itself."""
    with zipfile.ZipFile(TREE) as archive:
        texts = {name: archive.read(name) for name in archive.namelist()}
    commands = (
        "batch src new --plan plan.toml --jobs 1",
        "check new --source src --report new.json",
        "check dst --model abb/model.json --report old.json",
        "diff src/pdl/odd.pdl dst/pdl/odd.pdl --report diff.json",
        "explain src/pdl/odd.pdl --cell desk/cell.toml --report explained.json",
        "restore dst/pdl/odd.pdl -o back/odd.pdl",
    )
    return Case("tree", commands, texts=texts)


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> dict[str, dict[str, dict[str, str]]]:
    """The cases as they are, and scrambled."""
    root = tmp_path_factory.mktemp("scrambled").resolve()
    (root / "postproc").symlink_to(Path(postproc.__file__).parent)
    (root / "grammars").symlink_to(Path(postproc.__file__).parents[1] / "grammars")
    plain = run_all(chosen(), root, workers=1)
    (root / "sitecustomize.py").write_text((HERE / "sitecustomize.py").read_text())
    return {"plain": plain, "scrambled": run_all(chosen(), root, workers=1)}


def facts(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield what decides in a JSON output: statuses, codes, lines, counts."""
    if isinstance(value, dict):
        for name, own in value.items():
            yield from facts(own, name)
    elif isinstance(value, list):
        for own in value:
            yield from facts(own, key)
    elif key in DECIDING:
        yield key, value


def decided(record: dict[str, str]) -> dict[str, object]:
    """Return exit codes, and what JSON outputs say beside their texts."""
    out: dict[str, object] = {}
    for what, text in record.items():
        if what.endswith("exit"):
            out[what] = text
        elif what.endswith((".json", ".jsonl")):
            lines = text.splitlines() if what.endswith(".jsonl") else [text]
            found = [one for line in lines for one in facts(json.loads(line))]
            out[what] = sorted(map(str, found))
        elif what.endswith((".pdl", ".lsv", ".mod", ".src", ".dat")):
            out[what] = text
    return out


def test_nothing_is_decided_by_the_text_of_a_message(both):
    assert both["plain"].keys() == both["scrambled"].keys()
    for name, record in both["plain"].items():
        assert decided(both["scrambled"][name]) == decided(record), name


def test_the_messages_are_scrambled(both):
    text = both["scrambled"]["tree"]
    assert "its arrivals need" in both["plain"]["tree"]["new.batch.jsonl"]
    assert "its arrivals need" not in text["new.batch.jsonl"]
    assert "zq" in text["new.batch.jsonl"] and "zq" in text["new.json"]
