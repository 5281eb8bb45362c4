"""Cells whose arm runs programs of every language, for jobs that are written in all."""

from dataclasses import replace

from postproc.robot.cell import Cell

EVERY = 'controller = ["comau", "abb", "kuka"]'
"""Goes under [robot] of a cell file."""


def any_controller(cell: Cell) -> Cell:
    """Return a cell that accepts programs of every language."""
    said = {"controller": ["comau", "abb", "kuka"]}
    robot = cell.file.robot.model_copy(update=said)
    return replace(cell, file=cell.file.model_copy(update={"robot": robot}))


def told(text: str) -> str:
    """Say in a cell file what RAPID and KRL are refused without."""
    return text.replace("[tool]", "absolute_accuracy = false\n[tool]", 1)
