"""Imports point down only, and each foreign library has one door."""

from __future__ import annotations

import ast
import sys
from collections import defaultdict
from pathlib import Path

import postproc

PACKAGE = Path(postproc.__file__).parent
ROOMS = ("language", "robot", "motion", "accuracy", "virtual")
LEAVES = {"exceptions", "kernels", "pieces", "pose", "printable", "reasons", "spans"}

# What each room or root module may import of ours, besides itself and the leaves.
# A root module that is not listed (the verbs) may import everything but the CLI.
ALLOWED: dict[str, set[str]] = {
    **{leaf: set() for leaf in LEAVES},
    "exceptions": {"printable"},
    "pose": {"kernels"},
    "language": set(),
    "robot": set(),
    "motion": {"robot"},
    "files": set(),
    "accuracy": {"robot", "files"},
    "virtual": {"language", "files"},
}

# Foreign libraries that every module may use.
EVERYWHERE = {"numpy", "scipy"}


def modules() -> list[tuple[str, Path]]:
    """Return (dotted name below postproc, file) of every module of the package."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found.append((name, path))
    return found


def imported(name: str, path: Path) -> set[str]:
    """Return the dotted names that a module imports, lazy imports included."""
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    package = ["postproc", *name.split(".")] if name else ["postproc"]
    if path.name != "__init__.py":
        package = package[:-1]
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{module}.{alias.name}" for alias in node.names}
    return found


def ours(name: str, path: Path) -> set[str]:
    """Return the rooms and root modules of ours that a module imports."""
    parts = [i.split(".") for i in imported(name, path)]
    inside = {p[1] for p in parts if p[0] == "postproc" and len(p) > 1}
    return {i for i in inside if i in ROOMS or (PACKAGE / f"{i}.py").exists()}


def test_there_is_something_to_check() -> None:
    names = {name.split(".")[0] for name, _ in modules()}
    assert {"language", "robot", "motion", "accuracy", "pose"} <= names


def test_imports_point_down() -> None:
    wrong = []
    for name, path in modules():
        room = name.split(".")[0]
        if room not in ALLOWED:
            continue
        leaves = set() if room in LEAVES else LEAVES
        up = ours(name, path) - ALLOWED[room] - leaves - {room}
        wrong += [f"{name} imports {other}" for other in sorted(up)]
    assert not wrong, wrong


def test_the_verbs_know_neither_their_callers_nor_the_virtual_arm() -> None:
    for name, path in modules():
        if name in {"compensate", "calibrate", "report", "diff", "restore"}:
            assert not ours(name, path) & {"batch", "cli", "virtual"}, name


def test_nobody_imports_the_command_line() -> None:
    users = {name for name, path in modules() if "cli" in ours(name, path)}
    assert users <= {"__main__", "cli"}


def test_the_virtual_arm_is_independent() -> None:
    # Its truth would prove nothing if it used the kinematics under test.
    for name, path in modules():
        if name.split(".")[0] == "virtual":
            assert not ours(name, path) & {"robot", "accuracy", "motion"}, name


def test_each_foreign_library_is_imported_in_one_module() -> None:
    users: dict[str, set[str]] = defaultdict(set)
    for name, path in modules():
        for module in imported(name, path):
            users[module.split(".")[0]].add(name)
    foreign = {
        library: names
        for library, names in users.items()
        if library not in sys.stdlib_module_names
        and library not in EVERYWHERE | {"postproc"}
    }
    spread = {library: sorted(n) for library, n in foreign.items() if len(n) > 1}
    # The schemas of the cell and arm files and of the model file are two doors.
    pydantic = spread.pop("pydantic", [])
    assert {name.split(".")[0] for name in pydantic} <= {"robot", "accuracy"}
    # The command line is one door, cut by what its commands work on.
    assert {name.split(".")[0] for name in spread.pop("typer", [])} <= {"cli"}
    assert not spread, spread


def test_there_is_one_way_to_compensate() -> None:
    """The command line and the batch know `compensate` only, none of its steps."""
    steps = {"settling", "proposal", "output", "verify", "solved"}
    for name, path in modules():
        if name.split(".")[0] in {"cli", "batch", "jobs", "html"}:
            assert not ours(name, path) & steps, name
