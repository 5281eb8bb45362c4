"""What KRL programs import from the data lists of others."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from postproc.language.text.source import Source

_IMPORT = re.compile(  # of a name, from a list, by its name there
    rb"^[ \t]*(?:DECL[ \t]+)?IMPORT[ \t]+\w+[ \t]+(\w+)[^;\n]*?\bIS\b[^;\n]*?"
    rb"(\w+)[ \t]*\.\.[ \t]*(\w+)",
    re.IGNORECASE | re.MULTILINE,
)


@dataclass(frozen=True)
class ImportedDatum:
    """Data of the list of another program, by a name of its own.

    Attributes:
        name: What it is called where it is imported.
        module, original: The list that declares it, and its name there.
    """

    name: str
    module: str
    original: str


def list_imports(sources: Sequence[Source]) -> list[ImportedDatum]:
    """List what files import from lists of other programs."""
    found = (match for one in sources for match in _IMPORT.findall(one.data))
    return [
        ImportedDatum(*(part.decode("ascii").lower() for part in one)) for one in found
    ]
