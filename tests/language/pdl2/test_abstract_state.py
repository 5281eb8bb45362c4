"""What variables hold: elements come and go with what they belong to."""

from __future__ import annotations

from postproc.language.pdl2.abstract_state import Store
from postproc.language.pdl2.values import Nothing

ARRAYS = [f"job/t{k}" for k in range(60)]  # shelves go through them in any order


def unset(key: str) -> None:
    return None


def test_parts_are_what_was_written_since_the_whole_was_forgotten() -> None:
    store = Store(unset)
    for key in ("job/t[1]", "job/t[2].a", "job/t[2].b", "job/u[1]"):
        store.write(key, 1.0)
    assert store.parts("job/t") == ["job/t[1]", "job/t[2].a", "job/t[2].b"]
    assert store.parts("job/t[2]") == ["job/t[2].a", "job/t[2].b"]
    store.forget("job/t[2]", Nothing("read"))
    assert store.parts("job/t") == ["job/t[1]", "job/t[2]"]
    assert isinstance(store.read("job/t[2].a"), Nothing)
    store.forget("job/t", Nothing("read"))
    assert store.parts("job/t") == []
    store.write("job/t[2].b", 2.0)
    assert store.parts("job/t") == store.parts("job/t[2]") == ["job/t[2].b"]
    assert store.parts("job/u") == ["job/u[1]"]


def test_copies_have_parts_of_their_own() -> None:
    first = Store(unset)
    first.write("job/t[1]", 1.0)
    second = first.copy()
    second.write("job/t[2]", 2.0)
    first.write("job/t[3]", 3.0)
    first.forget("job/t", Nothing("read"))
    first.write("job/t[4]", 4.0)
    assert first.parts("job/t") == ["job/t[4]"]
    assert second.parts("job/t") == ["job/t[1]", "job/t[2]"]
    second = second.join(first)
    assert sorted(second.parts("job/t")) == ["job/t[1]", "job/t[2]", "job/t[4]"]
    assert first.parts("job/t") == ["job/t[4]"]
    second.drop("job/t")
    assert second.parts("job/t") == []
    assert second.get_assigned("job/t[1]") is second.get_assigned("job/t") is None


def test_an_element_that_is_the_same_on_both_ways_is_known() -> None:
    held = dict.fromkeys((f"{key}[1]" for key in ARRAYS), 7.0)
    one = Store(held.get)
    other = one.copy()
    for key in ARRAYS:
        other.forget(key, Nothing("read"))
        other.write(f"{key}[1]", 7.0)
    one = one.join(other)
    assert [one.read(f"{key}[1]") for key in ARRAYS] == [7.0] * len(ARRAYS)
    assert all(isinstance(one.read(f"{key}[2]"), Nothing) for key in ARRAYS)


def test_an_element_that_is_forgotten_again_is_entered_once() -> None:
    store = Store(lambda key: None)
    for _ in range(5):
        store.forget("job/tab[1]", Nothing("it may change"))
    assert store.logs.get("job/tab") == ("job/tab[1]", None)


def test_a_number_that_is_set_once_more_leaves_the_same_settings() -> None:
    store = Store(unset)
    store.set(lin_spd=0.2, move_type="linear")
    before = store.settings
    store.set(lin_spd=0.2)
    assert store.settings is before
    for other in (0.3, Nothing("read"), Nothing("read again"), True, 1.0):
        store.set(lin_spd=other)
        assert store.settings is not before and store.settings["lin_spd"] is other
        before = store.settings
