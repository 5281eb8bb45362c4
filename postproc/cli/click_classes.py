"""How commands are listed, and what options of earlier versions are called now."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

GROUPS = {
    "Calibrate": (
        "survey",
        "read",
        "fit",
        "diagnose",
        "history",
        "compare",
        "predict",
        "iso9283",
    ),
    "Compensate": ("compensate", "explain", "batch"),
    "Check": ("diff", "check", "restore", "report"),
    "Keep a plant": ("robot",),
    "Set up and try": ("init", "arm", "simulate"),
}
KEYS = {
    "--take-up": "compensation.preload_backlash=true",
    "--approach": "compensation.reapproach=true",
    "--max-inserted": "compensation.max_inserted=N",
    "--strict-calls": "compensation.assume_motion=true",
    "--shared": "compensation.edit_exported=true",
    "--timing": "compensation.timing=true",
    "--no-timing": "compensation.timing=false",
    "--measured-frame": "measurements.frame=FRAME",
    "--frame": "measurements.frame=FRAME",
    "--columns": "measurements.columns=FILE",
    "--delimiter": "measurements.delimiter=SIGN",
    "--decimal": "measurements.decimal=SIGN",
    "--encoding": "measurements.encoding=NAME",
    "--unit": "measurements.unit=UNIT",
    "--temperature": "environment.temperature_c=C",
    "--seed": "simulation.seed=N",
    "--orientation": "compensation.orientation=true",
    "--shared-points": "compensation.shared_points=KIND",
    "--path-tolerance": "compensation.path_tolerance_mm=MM",
    "survey --seed": "survey.seed=N",
    "--mode": "survey.mode=MODE",
    "--reversals": "survey.reversals=N",
    "--tracker": "tracker.xyz_mm=[X,Y,Z]",
    "--effects": "simulation.effects=EFFECTS",
    "--backlash-model": "simulation.backlash_model=MODEL",
    "--gears": "simulation.backlash_model=MODEL",
    "--rate": "simulation.track_rate_hz=HZ",
    "--refit": "measurements.refit_registration=true",
    "--after": "measurements.after_survey=true",
    "--second-opinion": "verify.second_opinion=true",
    "--no-second-opinion": "verify.second_opinion=false",
}
OLD_OPTIONS = {
    **{old: f"--set {key}" for old, key in KEYS.items()},
    "--scheduler": "--jobs tls://HOST:8786",
    "--arm": "--verify ARM",
    "--json": "--report FILE.json",
    "--html": "--report FILE.html",
    "--plot": "--report FILE.svg",
    "--clone": "--shared-points clone",
    "--path-mm": "--path-tolerance",
    "--accept-left": "--allow-uncorrected",
    "--wanted": "--reference",
    "--lsv": "--variables",
    "--lsv-out": "--variables-out",
    "--blocks": "--cv-blocks",
}


ENDED = {
    "--tls": "name the certificates in the configuration of Dask",
    "--log": "the log is DST.batch.jsonl",
    "--name": "change it in the arm file",
    "--repeatability": "change it in the arm file",
    "compensate --jobs": "limit the processors, as taskset does",
    "compensate -j": "limit the processors, as taskset does",
    "fit --all": "--report FILE.json has all parameters and rows",
    "explain --all": "--report FILE.json has all findings",
    "explain --variables": "the file is PROGRAM.lsv, beside the program",
}


class Command(TyperCommand):
    """A command that names the new word where an old one is given."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments; end with 2 where one is an option of an earlier version."""
        known = {word for param in self.params for word in param.opts}
        for arg in args:
            word = arg.partition("=")[0]
            if word not in known:
                for name in (f"{ctx.info_name} {word}", word):
                    if new := OLD_OPTIONS.get(name):
                        ctx.fail(f"{word} is called {new}")
                    if instead := ENDED.get(name):
                        ctx.fail(f"{word} is no option any more: {instead}")
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as exc:
            exc.message = exc.message.removeprefix("Value error, ")  # of pydantic
            raise


class Groups(TyperGroup):
    """The commands in the order of the work, with no line cut."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands, a section a step of the work."""
        for title, names in GROUPS.items():
            found = [(name, self.commands.get(name)) for name in names]
            rows = [(name, _first(one)) for name, one in found if one is not None]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _first(command: Any) -> str:
    """Return the first line of a command's help."""
    return str(command.help or "").strip().partition("\n")[0]
