"""All languages, and which one a file is written in."""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module

from postproc.files import KRL_DATA, KRL_PROGRAMS, KRL_SUBMITS, MODULES
from postproc.language.language import Language

# Languages by the suffixes of their files; one is loaded when its first file is read.
_PLACES = {
    ".pdl": "postproc.language.pdl2.language:Pdl2",
    ".lsv": "postproc.language.pdl2.language:Pdl2",
    **dict.fromkeys(MODULES, "postproc.language.rapid.language:Rapid"),
    **dict.fromkeys(
        (*KRL_PROGRAMS, KRL_DATA, *KRL_SUBMITS), "postproc.language.krl.language:Krl"
    ),
}
_USUAL = ".pdl"  # of a file with another suffix


def language_of(file: str) -> Language:
    """Return the language of a file, by its name.

    >>> language_of("a/JOB.PDL").name
    'PDL2'
    >>> language_of("Welding.modx").name
    'RAPID'
    >>> language_of("job.src").name
    'KRL'
    """
    suffix = os.path.splitext(file)[1].lower()
    return _load(_PLACES.get(suffix, _PLACES[_USUAL]))


def language_of_text(text: bytes) -> Language:
    """Return the language of a text without a name, by how it begins."""
    usual = language_of(_USUAL)
    return next((one for one in languages()[1:] if one.recognises(text)), usual)


def languages() -> tuple[Language, ...]:
    """Return all languages."""
    return tuple(_load(place) for place in dict.fromkeys(_PLACES.values()))


@cache
def _load(place: str) -> Language:
    module, _, name = place.partition(":")
    made: Language = getattr(import_module(module), name)()
    return made
