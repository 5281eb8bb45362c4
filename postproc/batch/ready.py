"""All that a worker needs for its first program, loaded before workers are forked."""

from postproc.language.pdl2.parser import line_parser

for _grammar in ("pdl2", "lsv"):
    line_parser(_grammar, "line")
