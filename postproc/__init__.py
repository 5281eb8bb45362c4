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
    from postproc.compensation.compensate import compensate
    from postproc.compensation.options import Options
    from postproc.compensation.outcome import Outcome
    from postproc.exceptions import PostprocError
    from postproc.model.model import Model, load_model
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
    "Options": "postproc.compensation.options",
    "Outcome": "postproc.compensation.outcome",
    "PostprocError": "postproc.exceptions",
    "compensate": "postproc.compensation.compensate",
    "load_cell": "postproc.robot.cell",
    "load_model": "postproc.model.model",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)
