"""The digests of the quick set, kept with the sources."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from tests.golden.case import HERE, Case
from tests.golden.cases import all_cases
from tests.golden.record import Digest, digest, digests_differ
from tests.golden.running import run_all

MANIFEST = HERE / "manifest.json"


def digests(cases: Iterable[Case], root: Path, workers: int) -> dict[str, Digest]:
    """Run cases and shorten their records."""
    cases = list(cases)
    records = run_all(cases, root, workers)
    return {case.name: digest(records[case.name], case.fitted) for case in cases}


def write_manifest(root: Path, workers: int) -> None:
    """Run the quick set and write what came out."""
    quick = [case for case in all_cases() if case.quick]
    found = dict(sorted(digests(quick, root, workers).items()))
    lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in found.items()]
    MANIFEST.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")


def changed(cases: Iterable[Case], root: Path, workers: int) -> dict[str, list[str]]:
    """Run cases; tell what differs from the manifest, by case."""
    wanted = json.loads(MANIFEST.read_text("utf-8"))
    found = digests(cases, root, workers)
    differ = {k: digests_differ(wanted.get(k, {}), v) for k, v in found.items()}
    return {name: whats for name, whats in differ.items() if whats}
