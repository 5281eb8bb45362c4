"""Which cell and which model a program is compensated with."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

from postproc import __version__
from postproc.compensation.options import Options
from postproc.exceptions import CellError
from postproc.model.model import Model, load_model
from postproc.robot.cell import Cell, load_cell


@dataclass(frozen=True)
class Setup:
    """A cell, a model and what the user asked for: all but the program itself."""

    cell: Cell
    model: Model
    options: Options

    @cached_property
    def digest(self) -> str:
        """Hash all that decides, beside the sources, what comes out.

        Contents count, places do not: a copy of the same cell file is the same cell.
        """
        parts = {
            "version": __version__,
            "cell": self.cell.file.model_dump(mode="json"),
            "arm": self.cell.arm.file.model_dump(mode="json"),
            "model": self.model.id,
            "options": asdict(self.options),
        }
        text = json.dumps(parts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def open_setup(cell: Path, model: Path, options: Options) -> Setup:
    """Load a cell and a model, and refuse a pair that does not belong together.

    Raises:
        CellError: The cell cannot be used, or its controller compensates on its own.
        ModelError: The model cannot be used, or was made for another arm.
    """
    loaded, fitted = load_cell(cell), load_model(model)
    fitted.check_arm(loaded.arm, model)
    if loaded.file.robot.absolute_accuracy:
        raise CellError(
            cell,
            "the controller compensates on its own: this would do it twice",
            "Switch that option off on the controller, then here",
            place="$.robot.absolute_accuracy",
        )
    # Only the name: messages must not depend on where a run was started.
    return Setup(replace(loaded, path=Path(cell.name)), fitted, options)
