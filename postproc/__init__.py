"""Offline-programming post-processor for industrial robots.

    import postproc

    cell, model = postproc.load_cell("cell.toml"), postproc.load_model("model.json")
    outcome = postproc.compensate(source, cell, model)

`outcome.outputs` holds the compensated program, `outcome.exit_code` says whether all of
its targets are compensated. Everything is loaded when it is first asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from postproc.compensate import compensate
    from postproc.exceptions import PostprocError
    from postproc.model.model import Model, load_model
    from postproc.options import Options
    from postproc.report import Outcome
    from postproc.robot.cell import Cell, load_cell

__version__ = "0.1.0"

__all__ = [
    "Cell",
    "Model",
    "Options",
    "Outcome",
    "PostprocError",
    "compensate",
    "load_cell",
    "load_model",
]

_PLACES = {
    "Cell": "postproc.robot.cell",
    "Model": "postproc.model.model",
    "Options": "postproc.options",
    "Outcome": "postproc.report",
    "PostprocError": "postproc.exceptions",
    "load_cell": "postproc.robot.cell",
    "load_model": "postproc.model.model",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name == "compensate":
        return import_module("postproc.compensate")  # a module that can be called
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)
