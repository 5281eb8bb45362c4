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
    names = {part[under:] for part in parts_under(here, key)}
    found = {name for name in names if name[:1] == "$" and "." not in name}
    standard = sorted(found | _declared(here, reference))
    fields = [
        here.value(ast.Reference(reference.name, (*reference.steps, name)))
        for name in standard
        if name in MAIN
    ]
    if not fields:
        return whole
    if _unread(here, key):
        return unsure(Nothing("its values in the variable file are not read"), *fields)
    if len(fields) == 1 == len(standard):
        return fields[0]
    several = len(fields) > 1
    why = "it has several positions" if several else "it has settings of its own"
    return unsure(Nothing(f"{why} ({', '.join(standard).upper()})"), *fields)


def _declared(here: Here, reference: ast.Reference) -> frozenset[str]:
    """Return the standard fields that the type of a node declares."""
    type_ = here.world.type_of(here.place, reference.name)
    steps = [step for step in reference.steps if isinstance(step, str)]
    if type_ is None or steps not in ([], ["node"]):
        return frozenset()
    found = [one.nodes.get(type_.name) for one in here.world.programs()]
    return frozenset().union(*filter(None, found))


def _unread(here: Here, key: str) -> bool:
    """Tell whether the variable file may say more of a node than what was read."""
    file, name = here.world.variables, key.rpartition("/")[2]
    unread = file.unread if file is not None else ()
    return any(f"{name}.".startswith((f"{one}.", f"{one}[")) for one in unread)
