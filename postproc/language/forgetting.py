"""What is no longer known, and what must stay because something may depend on it."""

from __future__ import annotations

from postproc.language import pdl2 as ast
from postproc.language.copies import forget_key, parts_under
from postproc.language.machine import Here
from postproc.language.values import Nothing


def forget_names(here: Here, names: frozenset[str], why: str) -> None:
    """Forget variables and settings (with ``$``) by name."""
    for name in names:
        if name.startswith("$"):
            here.store.set(**{name[1:]: Nothing(why)})
        elif name:
            forget(here, ast.Reference(name), why)


def pin_names(here: Here, names: frozenset[str], why: str) -> None:
    """Keep the numbers of variables that something not followed may depend on."""
    for name in sorted(names):
        if not name.startswith("$"):
            for key in here.locate(ast.Reference(name)).keys:
                for part in (key, *parts_under(here, key)):
                    here.world.pin(here.store.read(part), why)


def forget(here: Here, reference: ast.Reference, why: str) -> None:
    """Forget what a variable holds, unless it is a constant."""
    declared = here.world.declared(here.place, reference.name)
    if declared is not None and declared.constant:
        return
    if reference.name.startswith("$"):
        part = here.frame_part(reference)
        name = here.setting_name(reference) if part is None else part[0]
        if name in here.store.settings:
            here.store.set(**{str(name): Nothing(why)})
        return
    for key in here.locate(reference).keys:
        forget_key(here, key, why)
