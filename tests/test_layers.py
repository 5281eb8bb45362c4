"""Imports point down only, and each foreign library has one door."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import postproc

PACKAGE = Path(postproc.__file__).parent

# A chapter may import itself and what stands in the lines above its own; chapters of
# one line know nothing of each other. The table of contents of the package.
LAYERS = (
    ("exceptions", "arrays", "threads", "operating_system", "diagnostics", "_native"),
    ("files",),
    ("robot",),
    ("language", "motion", "model"),
    ("verify",),
    ("compensation", "simulation"),
    ("calibration",),
    ("record",),
    ("report",),
    ("batch",),
    ("cli",),
    ("__main__",),
)
LAYER = {chapter: k for k, layer in enumerate(LAYERS) for chapter in layer}
LEAVES = {
    "exceptions", "arrays", "threads", "operating_system", "files", "diagnostics",
}  # fmt: skip

# What a chapter may import less than its layer allows.
ONLY = {
    "language": LEAVES | {"_native", "robot.pose", "robot.trajectory"},
    # Its truth would prove nothing if it used the kinematics under test.
    "simulation": LEAVES | {"language", "robot.trajectory"},
    # A second opinion by the code that is judged would be the first one again.
    "verify": LEAVES | {"language", "robot.arm_file", "robot.trajectory"},
}

# Points that were measured while a program ran are joined with its visits.
JOINED = {
    "calibration.measured_program": {"program", "program_files"},
    "calibration.diagnosis.measured_path": {
        "paths.path_error",
        "paths.backlash_steps",
        "paths.track_alignment",
        "paths.servo_lag",
        "program",
        "program_files",
        "solver.targets",
    },
}

# Which modules know one effect in particular: all others take effects as they come.
# Who knows that there are windows, processes, and several programs at once.
SCALED = {
    "batch.workers": {"micro_batch"},
    "cli.programs": {"workers"},
    "compensation.compensate": {"workers"},
    "compensation.output.rewrite": {"workers"},
    "compensation.paths.changed_windows": {"windowing"},
    "compensation.pipeline": {"consensus", "window_work"},
    "compensation.solver.iterate": {"consensus"},
    "report.diff": {"workers"},
}

KNOWING = {
    # What may have changed since the arm was surveyed.
    "calibration.check_design": {"base_shift", "joint_offset", "tool_shift"},
    # Waves inside a map are what it names.
    "calibration.diagnosis.harmonics": {"transmission"},
    # The others move along the chain that it deviates.
    "model.effect_sum": {"geometry"},
    # The native kernel makes its columns and those of the joints itself.
    # Any survey must determine it, or be refused.
    "calibration.survey_checks": {"base_shift", "geometry"},
    # What the frame of the rows explains is no mistake of them.
    "calibration.likely_causes": {"base_shift", "placement"},
    # What the methods of the literature train.
    "calibration.baselines": {"elm", "geometry", "maps"},
    # How the rows were measured decides: frame, probe points, orientations, a slip.
    "calibration.fit": {"placement", "probe", "station_shift", "tool_shift"},
    # A fit must leave less than registration alone; weight makes any arm yield.
    "calibration.validation": {"compliance", "placement"},
    # Weight shows by what yields to it.
    "calibration.diagnosis.weight": {"compliance"},
    "calibration.weight_direction": {"compliance"},
    "calibration.doubt": {"compliance"},
    # The given model's zero of a joint holds the mean of what the model lacks.
    "calibration.diagnosis.jumps": {"part_motion", "step"},
    # Where a load jumps depends on what the links weigh.
    "calibration.diagnosis.link_weights": {"compliance"},
    "calibration.diagnosis.load_jumps": {"part_motion"},
    "calibration.diagnosis.step_places": {"part_motion"},
    # A law of the weight goes on to further joints; a cell is told beside no name.
    "calibration.diagnosis.search": {
        "compliance",
        "curve",
        "joint_offset",
        "part_motion",
    },
    # What has no name is a motion of a part, by a law or by a free curve.
    "calibration.diagnosis.table": {"curve", "part_motion"},
    # A registration is what that effect fits, by the rigid motions of a base.
    "calibration.registration": {"placement"},
    # A tracker that drifts moves fixed points rigidly.
    "calibration.monuments": {"base_shift", "tracker_drift"},
    "calibration.effect_selection": {"probe_turn", "tool_shift"},
    "calibration.diagnosis.files": {"placement"},
    # What a mastering by marks leaves of zeros, and where the base may be.
    "record.events": {"geometry"},
    # Fixed points are seen rigidly moved where the tracker stands elsewhere.
    "record.check_rows": {"base_shift"},
}

# Foreign libraries that every module may use.
EVERYWHERE = {"numpy", "scipy"}


@cache
def modules() -> list[tuple[str, Path]]:
    """Return (dotted name below postproc, file) of every module of the package."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found.append((name, path))
    return found


@cache
def syntax(path: Path) -> ast.Module:
    """Parse a module."""
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


@cache
def imported(name: str, path: Path) -> set[str]:
    """Return the dotted names that a module imports, lazy imports included."""
    tree = syntax(path)
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


@cache
def ours(name: str, path: Path) -> set[str]:
    """Return the modules of ours that a module imports, dotted below postproc."""
    names = {known for known, _ in modules()} | {"_native"}
    inside = set()
    for full in imported(name, path):
        own = full.removeprefix("postproc.")
        if own != full:
            inside.add(own if own in names else own.rpartition(".")[0])
    return inside - {""}


def within(module: str, places: set[str]) -> bool:
    """Tell whether a module is one of some places, or lies in one."""
    return any(module == place or module.startswith(f"{place}.") for place in places)


def test_the_root_is_the_table_of_contents() -> None:
    chapters = {name.split(".")[0] for name, _ in modules()} - {""} | {"_native"}
    assert chapters == set(LAYER)


def test_imports_point_down() -> None:
    wrong = []
    for name, path in modules():
        if not name:
            continue  # the package itself: it loads lazily what it names
        chapter = name.split(".")[0]
        for other in sorted(ours(name, path)):
            first = other.split(".")[0]
            if first == chapter:
                continue
            down = LAYER[first] < LAYER[chapter] or {first, chapter} <= set(LAYERS[0])
            if not down or not within(other, ONLY.get(chapter, {first})):
                wrong.append(f"{name} imports {other}")
    assert not wrong, wrong


def test_calibration_knows_compensation_where_a_program_was_measured() -> None:
    found = {
        name: {o.removeprefix("compensation.") for o in own}
        for name, path in modules()
        if name.startswith("calibration.")
        and (own := {o for o in ours(name, path) if o.startswith("compensation.")})
    }
    assert found == JOINED


def test_few_know_that_long_programs_are_cut() -> None:
    scale = {n for n, _ in modules() if n.startswith("compensation.scale.")}
    found = {
        name: {other.rpartition(".")[2] for other in own}
        for name, path in modules()
        if name not in scale and (own := ours(name, path) & scale)
    }
    assert found == SCALED


def test_an_effect_is_known_to_its_own_file_and_to_the_list() -> None:
    effects = {name for name, _ in modules() if name.startswith("model.effects.")}
    effects -= {"model.effects.effect", "model.effects.policies"}
    found = {}
    for name, path in modules():
        own = {other.rpartition(".")[2] for other in ours(name, path) & effects}
        if own and not within(name, {"model.effects"}):
            found[name] = own
    assert found == KNOWING


def test_no_two_classes_have_one_name() -> None:
    places = defaultdict(list)
    for name, path in modules():
        for node in ast.walk(syntax(path)):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(name)
    assert not {c: where for c, where in places.items() if len(where) > 1}


def test_no_ring_of_imports() -> None:
    """Modules can be loaded in some order, each before those that import it."""
    needs = {name: ours(name, path) - {name} for name, path in modules() if name}
    left = dict(needs)
    while free := {name for name, on in left.items() if not on & set(left)}:
        left = {name: on for name, on in left.items() if name not in free}
    assert not left, sorted(left)


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
    assert {name.split(".")[0] for name in pydantic} <= {"robot", "model"}
    # The command line is one door, cut by what its commands work on.
    assert {name.split(".")[0] for name in spread.pop("typer", [])} <= {"cli"}
    # Grammars have one door, and what comes of them another.
    doors = {name.split(".")[-1] for name in spread.pop("lark", [])}
    assert doors == {"grammars", "template_parser"}
    # The second opinion shares no way of calling it with what it judges.
    assert spread.pop("ruckig", []) == ["motion.ruckig", "verify.ruckig_move"]
    assert not spread, spread


def test_the_second_opinion_loads_its_libraries_where_it_needs_them() -> None:
    """No command is slower for it, and without the extra nothing else changes."""
    code = "import sys, postproc.verify.judge; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"pinocchio", "toppra", "ruckig", "matplotlib"} & set(loaded)


LANGUAGE_FOLDERS = {
    f"language.{path.parent.name}" for path in PACKAGE.glob("language/*/language.py")
}


def test_a_language_knows_no_other() -> None:
    """What two languages need is neutral."""
    found = set()
    for name, path in modules():
        own = name.removeprefix("language.").split(".")[0]
        if name.startswith("language.") and (PACKAGE / "language" / own).is_dir():
            for other in ours(name, path):
                if within(other, LANGUAGE_FOLDERS - {f"language.{own}"}):
                    found.add((own, other))
    assert not found


def test_languages_are_known_by_their_interface_alone() -> None:
    """Outside of its folder nobody imports a language, not even the list of them."""
    folders = LANGUAGE_FOLDERS
    wrong = [
        f"{name} imports {other}"
        for name, path in modules()
        if not within(name, folders)
        for other in sorted(ours(name, path))
        if within(other, folders)
    ]
    assert len(folders) > 1
    assert not wrong, wrong


SUFFIX = re.compile(r"\.(?:pdl|lsv|cod|var|modx?|prg|sysx?|src|dat|sub)\b", re.I)
LANGUAGES = re.compile(r"rapid|krl|pdl2", re.I)
# Texts for people name files and languages; so does the list of languages itself, and
# what reads the archive of one maker's controllers to describe an arm.
NAMING = {"diagnostics", "language.languages", "robot.machine_data"}


def words_of(path: Path, for_people: bool) -> Iterator[str]:
    """Yield the names and the texts of a module, but for its docstrings.

    Args:
        path: Its file.
        for_people: Its texts of several words are written for people.
    """
    nodes = list(ast.walk(syntax(path)))
    told = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        for field in ("id", "attr", "arg", "name"):
            if isinstance(word := getattr(node, field, None), str):
                yield word
        if isinstance(node, ast.Constant) and id(node) not in told:
            text = str(node.value)
            if not (for_people and (" " in text or text.startswith("PROGRAM."))):
                yield text


def test_nothing_outside_of_its_folder_names_a_language() -> None:
    """Neither by its name nor by the suffixes of its files."""
    folders = LANGUAGE_FOLDERS
    found = [
        f"{name}: {word}"
        for name, path in modules()
        if not within(name, folders | NAMING)
        for word in words_of(path, within(name, {"cli"}))
        if LANGUAGES.search(word) or SUFFIX.search(word)
    ]
    assert not found, found


def test_there_is_one_way_to_compensate() -> None:
    """The command line and the batch know `compensate` only, none of its steps."""
    steps = {
        "solver.iterate",
        "solver.decisions",
        "solver.inverse_model",
        "eligibility.configuration_flags",
        "output.rewrite",
        "output.clones",
    }
    for name, path in modules():
        if name.split(".")[0] in {"cli", "batch", "report"}:
            inside = {f"compensation.{step}" for step in steps}
            assert not ours(name, path) & inside, name
