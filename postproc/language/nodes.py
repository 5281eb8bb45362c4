"""Nodes of paths as destinations: where the one position of a node stands."""

from __future__ import annotations

from postproc.language import pdl2 as ast
from postproc.language.copies import SINGLE, parts_under
from postproc.language.machine import Here
from postproc.language.values import Nothing, Value, unsure

MAIN = ("$main_pos", "$main_jntp", "$main_xtnd")


def may_be_node(here: Here, reference: ast.Reference) -> bool:
    """Tell whether a reference may mean a node of a path, or what is in one."""
    type_ = here.world.type_of(here.place, reference.name)
    if type_ is None:
        return reference.steps[:1] == ("node",)
    return type_.path or type_.name not in SINGLE


def destination(here: Here, reference: ast.Reference) -> Value:
    """Return where a move to what may be a node goes: to the one position in it.

    What other standard fields (``$LIN_SPD``, ``$SEG_TOOL_IDX``) of a node do in a move
    to it no public source tells: such a node is not known, and keeps its numbers.
    """
    whole = here.value(reference)
    target = here.locate(reference)
    if not isinstance(whole, Nothing) or not target.exact or target.component != ():
        return whole
    (key,) = target.keys
    under = len(key) + 1
    names = sorted({part[under:] for part in parts_under(here, key)})
    standard = [name for name in names if name[:1] == "$" and "." not in name]
    fields = [
        here.value(ast.Reference(reference.name, (*reference.steps, name)))
        for name in standard
        if name in MAIN
    ]
    if len(fields) == 1 == len(standard):
        return fields[0]
    if not fields:
        return whole
    several = len(fields) > 1
    why = "it has several positions" if several else "it has settings of its own"
    return unsure(Nothing(f"{why} ({', '.join(standard).upper()})"), *fields)
