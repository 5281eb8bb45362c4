"""Names by the million, as the core keeps them."""

from postproc._native import NameColumn

__all__ = ["NameColumn"]
