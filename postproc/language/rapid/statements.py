"""Statements of a RAPID file."""

from __future__ import annotations

from postproc import _native
from postproc.language.ir import SourceStatement
from postproc.language.rapid.parser import parse_statement
from postproc.language.text.source import Source
from postproc.language.text.statement_table import StatementText, read_text

RapidText = StatementText[SourceStatement]


def read_statements(source: Source) -> RapidText:
    """Read the statements of a RAPID file.

    A statement ends with ``;``, or where its words are complete (``ENDPROC``,
    ``IF a THEN``), whatever lines it stands on.

    Raises:
        ProgramError: A string or the header does not end.
    """
    return read_text(source, _native.scan_statements, parse_statement)
