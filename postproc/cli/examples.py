"""What every command looks like in use; its --help shows them."""

from __future__ import annotations

KEEP = "\b"  # begins a paragraph whose lines are not wrapped

EXAMPLES: dict[str, tuple[str, ...]] = {
    "compensate": (
        "postproc compensate job.pdl --cell cell.toml --model model.json",
        "postproc compensate job.pdl --cell cell.toml --model model.json"
        " -o out/job.pdl --html job.html",
        "cat job.pdl | postproc compensate - --cell cell.toml --model model.json > out",
    ),
    "diff": (
        "postproc diff job.pdl out/job.pdl | less -S",
        "postproc diff job.pdl out/job.pdl --json -",
    ),
    "restore": (
        "postproc restore out/job.pdl",
        "postproc restore out/job.pdl -o original.pdl",
    ),
    "explain": (
        "postproc explain job.pdl --cell cell.toml",
        "postproc explain job.pdl --cell cell.toml --model model.json --line 42",
    ),
    "survey": ("postproc survey --cell cell.toml --poses 300 -o survey.pdl",),
    "simulate": (
        "postproc simulate survey.pdl --cell cell.toml -o measured.csv",
        "postproc simulate out/job.pdl --cell cell.toml --wanted job.pdl",
    ),
    "fit": (
        "postproc fit measured.csv --cell cell.toml -o model.json --html model.html",
        "postproc fit measured.csv --cell cell.toml -o model.json --frame tracker",
    ),
    "predict": (
        "postproc predict states.csv --cell cell.toml --model model.json -o errors.csv",
    ),
    "compare": (
        "postproc compare measured.csv --cell cell.toml --html methods.html",
        "postproc compare measured.csv --cell cell.toml --plot methods.svg",
    ),
    "diagnose": (
        "postproc diagnose fresh.csv --cell cell.toml --model model.json"
        " -o better.json --html diagnosis.html",
        "postproc diagnose points.csv --program job.pdl --cell cell.toml"
        " --model model.json",
    ),
    "history": ("postproc history better.json",),
    "report": (
        "postproc report model.json -o model.html",
        "postproc report diagnosis.json -o diagnosis.html",
    ),
    "batch": (
        "postproc batch nominal compensated --cell cell.toml --model model.json"
        " --jobs 8",
        "postproc batch nominal compensated --plan batch.toml --resume",
    ),
    "check": ("postproc check compensated --model model.json --source nominal",),
}


def epilog(command: str) -> str | None:
    """Write the examples of a command for the end of its help."""
    lines = EXAMPLES.get(command)
    return None if lines is None else "\n".join([KEEP, "Examples:", *_indented(lines)])


def _indented(lines: tuple[str, ...]) -> list[str]:
    """Indent the lines."""
    return [f"  {line}" for line in lines]
