"""All that a worker needs for its first program, loaded before workers are forked."""

from postproc.batch import work as work
from postproc.language.parser import line_parser

for _grammar in ("pdl2", "lsv"):
    line_parser(_grammar, "line")
