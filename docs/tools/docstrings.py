"""Extension of Griffe, which reads docstrings: ``lower, upper: ..`` are two names."""

from __future__ import annotations

import re
from typing import Any

import griffe

SEVERAL = re.compile(r"(?m)^( +)((?:\w+, )+\w+): (.*(?:\n\1 +\S.*)*)")


class SeveralNames(griffe.Extension):
    """Give each of several names on one line what is said of all."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change the docstring of an object before it is parsed."""
        if obj.docstring is not None:
            obj.docstring.value = SEVERAL.sub(one_by_one, obj.docstring.value)


def one_by_one(found: re.Match[str]) -> str:
    r"""Write an entry for each name.

    >>> one_by_one(SEVERAL.search("Args:\n    a, b: Two\n        numbers.\n"))
    '    a: Two\n        numbers.\n    b: Two\n        numbers.'
    """
    indent, names, text = found.groups()
    return "\n".join(f"{indent}{name}: {text}" for name in names.split(", "))
