"""Random programs with known flow.

A generator writes the text of a program and, beside every line, an instruction of a
tiny machine, which the interpreter runs.
"""

from tests.language.pdl2.generator.generator import Generator
from tests.language.pdl2.generator.writer import POINTS

__all__ = ["POINTS", "Generator"]
