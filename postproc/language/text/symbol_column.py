"""Names by the million, as the core keeps them."""

from collections.abc import Sequence

from postproc._native import NameColumn

__all__ = ["NameColumn"]

Sequence.register(NameColumn)  # as the stub of the core says
