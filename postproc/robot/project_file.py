"""What a project file holds."""

from __future__ import annotations

from postproc.robot.arm_file import Strict


class ProjectFile(Strict):
    """A whole project file; places are relative to it.

    Attributes:
        cell: The cell file.
        model: The model that `fit` writes and others use.
        source: The folder of programs.
        output: The folder of compensated programs.
    """

    cell: str | None = None
    model: str | None = None
    source: str | None = None
    output: str | None = None
