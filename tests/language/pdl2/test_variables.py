"""Declared variables by name, list by list."""

from postproc.language import ir
from postproc.language.pdl2 import syntax as ast
from postproc.language.pdl2.program import Variable, Variables


def declared() -> Variables:
    found = Variables()
    found.declare(["P1", "p2"], Variable("", 3, ast.Type("position")))
    found.declare(["n"], Variable("", 4, ast.Type("integer"), ir.Num(0)))
    found.declare(["p2", "Q"], Variable("", 5, ast.Type("xtndpos"), taught=True))
    return found


def test_the_last_declaration_counts_in_the_place_of_the_first() -> None:
    found = declared()
    assert [*found] == ["p1", "p2", "n", "q"] and len(found) == 4
    assert found["p2"] == Variable("p2", 5, ast.Type("xtndpos"), taught=True)
    assert found["p1"].name == "P1" and found.get("P1") is None
    found.declare(["P2"], Variable("", 9))
    assert found["p2"] == Variable("P2", 9)
    assert [found[name].name for name in found] == ["P1", "P2", "n", "Q"]


def test_names_are_told_by_their_declarations() -> None:
    found = declared()
    assert found.which(lambda v: v.initial is not None) == ["n"]
    assert found.which(lambda v: v.taught) == ["p2", "q"]
    names = ["q", "nobody", "n", "p1", "p2"]
    told = found.passing(names, lambda v: v.taught)
    assert told.tolist() == [True, False, False, False, True]
    assert not Variables().passing(names, lambda v: True).any()
    assert not Variables().which(lambda v: True)
