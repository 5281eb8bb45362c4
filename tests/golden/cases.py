"""All cases."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from tests.golden.case import Case, below, folders, kept
from tests.golden.krl_cases import krl
from tests.golden.rapid_cases import rapid

DESK = {"cell.toml": "desk/cell.toml", "model.json": "desk/model.json"}
CELL = {"cell.toml": "programs/cell.toml"}
PLANT = {**CELL, "model.json": "models/default.json"}
SETUP = "--cell cell.toml --model model.json"
COMPENSATE = f"compensate job.pdl {SETUP} -o out/job.pdl"
FITTED = ("default", "effects", "elm", "joint_map")  # models with named effects
LEARNED = ("eja-elm", "interpolation", "kriging")  # models of other methods
EXPORTED = "--set compensation.edit_exported=true"
OPTIONS = {
    "--orientation": "--orientation",
    "--clone": "--shared-points clone",
    "--strict": "--strict",
    "--clone --shared": f"--shared-points clone {EXPORTED}",
}  # by what their cases are called
COMMANDS = (
    "compensate", "diff", "restore", "explain", "survey", "simulate", "fit", "predict",
    "compare", "diagnose", "history", "report", "batch", "check",
)  # fmt: skip


def job(name: str) -> dict[str, str]:
    """Return the files of a shipped program, named job."""
    found = {f"job{n[-4:]}": n for n in kept() if n.startswith(f"programs/{name}.")}
    return found


@cache
def all_cases() -> tuple[Case, ...]:
    """Return all cases, those that take long first."""
    makers = (
        large,
        studies,
        trees,
        samples,
        effects,
        made,
        small,
        pages,
        refused,
        krl,
        rapid,
        helps,
    )
    return tuple(case for maker in makers for case in maker())


def large() -> Iterator[Case]:
    """A program long enough to be corrected in windows, by several processes."""
    whole = kept()["programs/milling.pdl"]
    head, begin, rest = whole.partition(b"ROUTINE R_milling\nBEGIN\n")
    body, end, tail = rest.partition(b"END R_milling")
    text = head + begin + body * 8 + end + tail
    command = f"{COMPENSATE} --report report.json"
    yield Case("large/windows", (command,), PLANT, {"job.pdl": text})


def studies() -> Iterator[Case]:
    """Commands that fit, diagnose and compare."""
    survey = {**CELL, "survey.csv": "surveys/default.csv"}
    fit = "fit survey.csv --cell cell.toml -o fitted.json"
    report = "report fitted.json -o page.html"
    predict = "predict survey.csv --cell cell.toml --model fitted.json -o p.csv"
    worn = {**PLANT, "worn.csv": "surveys/worn.csv"}
    diagnose = f"diagnose worn.csv {SETUP} -o better.json --report diagnosis.json"
    shown = ("history better.json", "history better.json --report history.json")
    pages = ("report diagnosis.json -o d.html", "report better.json -o b.html")
    compare = (
        "compare survey.csv --cell cell.toml --report compared.json --report c.html"
    )
    yield Case("diagnose", (diagnose, *shown, *pages), worn, fitted=True)
    yield Case("compare", (compare,), survey, fitted=True)
    yield Case(
        "fit/full", (f"{fit} --report f.html", report, predict), survey, fitted=True
    )
    for method in ("eja-elm", "elm", "interpolation", "kinematic-elm", "kriging"):
        commands = (f"{fit} --method {method}", predict, report)
        yield Case(f"fit/{method}", commands, survey, fitted=True)
    varied = {**CELL, "survey.csv": "surveys/effects.csv"}
    for names in ("geometry,backlash,thermal,payload", "geometry,windup,lag,scale"):
        yield Case(f"fit/{names}", (f"{fit} --effects {names}",), varied, fitted=True)
    tracker = f"{fit} --set measurements.frame=tracker --effects geometry,backlash"
    yield Case("fit/tracker", (tracker,), survey, fitted=True)
    for mode in ("lhs", "optimal", "d-optimal"):
        design = f"--set survey.mode={mode} --set survey.seed=3"
        command = f"survey --cell cell.toml --poses 20 {design} -o s.pdl"
        arm = "--set simulation.seed=5 --set simulation.effects=thermal"
        run = f"simulate s.pdl --cell cell.toml {arm} -o s.csv"
        yield Case(f"survey/{mode}", (command, run), CELL)
    rows = {**CELL, "rows.csv": "surveys/effects.csv"}
    yield Case("simulate/rows", ("simulate rows.csv --cell cell.toml -o s.csv",), rows)
    for model in (*FITTED, *LEARNED):
        files = {**CELL, "rows.csv": "surveys/effects.csv"}
        files["model.json"] = f"models/{model}.json"
        commands = (
            f"predict rows.csv {SETUP} -o p.csv",
            "history model.json",
            "report model.json -o model.html",
        )
        yield Case(f"predict/{model}", commands, files, quick=model == "effects")


def trees() -> Iterator[Case]:
    """Trees of programs."""
    tree = {**PLANT, **DESK, **{f"src/{k}": v for k, v in below("tree").items()}}
    batch = f"batch src dst {SETUP}"
    after = (
        "check dst --model model.json --source src --report check.json",
        "check dst --allow-uncorrected",
        f"{batch} --resume --jobs 1",
    )
    yield Case("batch/one", (f"{batch} --jobs 1 --report b.html", *after), tree)
    yield Case(
        "batch/two",
        (f"{batch} --jobs 2 --set compensation.shared_points=clone", *after[:2]),
        tree,
    )
    plan = b'[[rule]]\npattern = "**/*.pdl"\ncell = "cell.toml"\nmodel = "model.json"\n'
    warm = "--set environment.temperature_c=30"
    command = f"batch src dst --plan plan.toml --jobs 1 {warm}"
    yield Case("batch/plan", (command,), tree, {"plan.toml": plan})


def samples() -> Iterator[Case]:
    """The shipped programs, with all that is shown of them."""
    for name in ("drilling", "handling", "spot", "milling"):
        files = {**PLANT, **job(name)}
        line = "--line 60"
        commands = (
            f"{COMPENSATE} --report report.json --report page.html",
            "diff job.pdl out/job.pdl",
            "diff job.pdl out/job.pdl --report diff.json",
            f"explain job.pdl {SETUP}",
            f"explain job.pdl {SETUP} {line} --report explained.json",
            "report report.json -o again.html",
            "restore out/job.pdl -o back.pdl",
            "restore out/job.pdl",
        )
        yield Case(f"programs/{name}", commands, files)
        quick = (
            commands[0].partition(" --report page")[0],
            *commands[1:3],
            commands[6],
        )
        if name != "milling":
            yield Case(f"quick/{name}", quick, files, quick=True)


def effects() -> Iterator[Case]:
    """Programs with every model, and with every option."""
    for model in (*FITTED, *LEARNED):
        files = {**CELL, **job("spot"), "model.json": f"models/{model}.json"}
        quick = model in ("effects", "elm")
        command = f"{COMPENSATE} --report report.json"
        yield Case(f"models/{model}/spot", (command,), files, quick=quick)
        files = {**CELL, **job("handling"), "model.json": f"models/{model}.json"}
        warm = "--set environment.temperature_c=22.4"
        command = f"{COMPENSATE} --report report.json {warm} {EXPORTED}"
        yield Case(f"models/{model}/handling", (command,), files)
    for name in ("drilling", "handling", "spot"):
        for short, option in OPTIONS.items():
            files = {**PLANT, **job(name)}
            yield Case(f"options/{name}{short}", (f"{COMPENSATE} {option}",), files)
    values = "--variables job.lsv --variables-out out.lsv"
    streams = f"compensate - {SETUP} {values} --report r.json < job.pdl"
    files = {**PLANT, **job("spot")}
    yield Case("stdin", (streams,), files, quick=True)
    commands = (f"compensate job.pdl {SETUP}", f"compensate job.pdl {SETUP} --report -")
    yield Case("beside", commands, files)


def made() -> Iterator[Case]:
    """Programs of the bench: the forms that users bring."""
    for name in folders("made"):
        files = {**PLANT, **below(f"made/{name}")}
        pdl = next(place for place in files if place.endswith(".pdl"))
        command = f"compensate {pdl} {SETUP} -o out/{pdl} --report report.json"
        after = (
            f"diff {pdl} out/{pdl} --report diff.json",
            f"explain {pdl} {SETUP} --report explained.json",
            f"simulate out/{pdl} --cell cell.toml --reference {pdl} --report true.json",
        )
        yield Case(f"made/{name}", (command, *after), files, quick=name == "drilling")


def small() -> Iterator[Case]:
    """Programs of some lines, each a construct of the language."""
    for group in ("cases", "corpus", "shared", "damaged", "generated"):
        for at, name in enumerate(folders(group)):
            files = {**DESK, **below(f"{group}/{name}")}
            command = f"{COMPENSATE} --report report.json"
            after = (f"explain job.pdl {SETUP}", "diff job.pdl out/job.pdl")
            quick = group != "generated" or at % 4 == 0
            clone = f"{COMPENSATE} --report report.json --shared-points clone"
            back = ("restore out/job.pdl -o back/job.pdl",)
            yield Case(f"{group}/{name}/all", (command, *after, *back), files)
            few = (clone if group == "shared" else command,)
            yield Case(f"{group}/{name}", few, files, quick=quick)
            if group in ("shared", "generated"):
                after = ("diff job.pdl out/job.pdl --report diff.json",)
                yield Case(f"{group}/{name}/clone", (clone, *after), files)


def pages() -> Iterator[Case]:
    """A program of several pages."""
    files = {**DESK, **below("tree/paged")}
    command = f"compensate main.pdl {SETUP} -o out/main.pdl --report report.json"
    after = ("diff main.pdl out/main.pdl", "restore out/main.pdl -o back/main.pdl")
    explain = f"explain main.pdl {SETUP} --report explained.json"
    yield Case("pages", (command, *after, explain), files, quick=True)


def refused() -> Iterator[Case]:
    """Bad input: the message, and exit code 2."""
    cell, model = kept()["desk/cell.toml"], kept()["desk/model.json"]
    program = kept()["cases/inline/job.pdl"]
    one = f"compensate job.pdl {SETUP} -o out.pdl"
    bad = {
        "empty": {"job.pdl": b""},
        "table": {"job.pdl": b"id;x_mm;y_mm\n1;2;3\n"},
        "binary": {"job.pdl": bytes(range(256)) * 9},
        "utf-16": {"job.pdl": "PROGRAM x\nBEGIN\nEND x".encode("utf-16")},
        "string": {"job.pdl": b"PROGRAM x\nBEGIN\n  s := 'abc\nEND x\n"},
        "arm": {"cell.toml": b'[robot]\narm = "nosuch"\n'},
        "key": {"cell.toml": cell + b"\n[nosuch]\na = 1\n"},
        "toml": {"cell.toml": b"[robot\n"},
        "absolute": {"cell.toml": cell.replace(
            b"[tool]", b"absolute_accuracy = true\n[tool]", 1)},
        "version": {"model.json": b'{"format": 99}'},
        "json": {"model.json": model[:500]},
        "list": {"model.json": b"[]"},
    }  # fmt: skip
    for name, texts in bad.items():
        files = {k: v for k, v in DESK.items() if k not in texts}
        texts = {"job.pdl": program, **texts}
        yield Case(f"refused/{name}", (one,), files, texts, quick=name in QUICK)
    files = {**DESK, "job.pdl": "cases/inline/job.pdl"}
    for name, command in {
        "no-program": f"compensate none.pdl {SETUP}",
        "no-cell": "compensate job.pdl --cell none.toml --model model.json",
        "no-model": "compensate job.pdl --cell cell.toml --model none.json",
        "over-input": f"compensate job.pdl {SETUP} -o job.pdl",
        "report-stdout": f"compensate - {SETUP} --report - < job.pdl",
        "no-record": "restore job.pdl",
        "no-tree": f"batch none out {SETUP} --jobs 1",
        "no-table": "fit job.pdl --cell cell.toml -o m.json",
        "no-effect": "fit none.csv --cell cell.toml -o m.json --effects nosuch",
        "no-line": f"explain job.pdl {SETUP} --line 99999",
        "no-report": "report job.pdl -o page.html",
        "history": "history cell.toml",
    }.items():
        yield Case(f"refused/{name}", (command,), files, quick=name in QUICK)
    again = (one, f"compensate out.pdl {SETUP} -o again.pdl")
    yield Case("refused/again", again, files, quick=True)


QUICK = {
    "empty", "table", "binary", "utf-16", "string", "absolute", "no-program",
    "no-record", "over-input", "no-line",
}  # whose messages hold none of Python or of a library  # fmt: skip


def helps() -> Iterator[Case]:
    """The help of every command."""
    commands = ("--help", "--version", *(f"{name} --help" for name in COMMANDS))
    yield Case("help", commands)
    usage = ("compensate", "nosuch", "compensate --nosuch", "fit --method nosuch")
    yield Case("usage", usage)
