"""All languages, and which one a file is written in."""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from pathlib import PurePath
from typing import TYPE_CHECKING

from postproc.language.file_name import FileName

if TYPE_CHECKING:
    from postproc.language.language import Language

# A language is a folder here, with its FILES and, loaded when its first file is read,
# its LANGUAGE. The first is that of a file with another suffix.
_FOLDERS = ("pdl2", "rapid", "krl")


def language_of(file: str) -> Language:
    """Return the language of a file, by its name.

    >>> language_of("a/JOB.PDL").name
    'PDL2'
    >>> language_of("Welding.modx").name
    'RAPID'
    >>> language_of("job.src").name
    'KRL'
    """
    return _load(_folder_of(file))


def language_of_text(text: bytes) -> Language:
    """Return the language of a text without a name, by how it begins."""
    usual, *others = languages()
    return next((one for one in others if one.recognises(text)), usual)


def languages() -> tuple[Language, ...]:
    """Return all languages."""
    return tuple(map(_load, _FOLDERS))


def file_named(place: str | PurePath) -> FileName:
    r"""Return a file as its language takes it; nothing of the language is loaded.

    >>> names = "a/JOB.PDL", "Job.mod", "job.src", "job.dat", "x.sub", "a.txt"
    >>> files = [file_named(name) for name in names]
    >>> [file.is_program for file in files]
    [True, True, True, False, False, False]
    >>> [file.key for file in files[:3]]
    ['job', 'job.mod', 'job.src']
    >>> [file.variables for file in files[:3]]
    ['a/JOB.lsv', '', '']
    >>> [file.data_list for file in files[:3]]
    ['', '', 'job.dat']
    """
    place = str(place)
    return _files(_folder_of(place))(place)


def _folder_of(place: str) -> str:
    suffix = os.path.splitext(place)[1].lower()
    return _folders_by_suffix().get(suffix, _FOLDERS[0])


@cache
def _folders_by_suffix() -> dict[str, str]:
    return {suffix: one for one in _FOLDERS for suffix in _files(one).suffixes()}


@cache
def _files(folder: str) -> type[FileName]:
    named: type[FileName] = import_module(f"{__package__}.{folder}.files").FILES
    return named


@cache
def _load(folder: str) -> Language:
    made: Language = import_module(f"{__package__}.{folder}.language").LANGUAGE()
    return made


UNNAMED = "program" + _files(_FOLDERS[0]).programs[0]  # what bytes are called
