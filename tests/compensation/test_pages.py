"""Which files belong to a job, and which are outputs beside it."""

from __future__ import annotations

import pytest

from postproc.compensation.output.sidecar import sidecar_path
from postproc.compensation.pages import group_pages, names_in
from postproc.compensation.program_files import find_pages
from postproc.files import FolderListing
from postproc.language.text.source import Source
from postproc.language.text.stamp import stamp_line

MAIN = b"MODULE main\nPROC main()\nENDPROC\nENDMODULE\n"
PART = b"MODULE part\nPROC edge()\nENDPROC\nENDMODULE\n"


@pytest.mark.parametrize("stamped", [True, False])
def test_outputs_are_no_modules_of_the_task(tmp_path, stamped):
    for name, text in (("main.mod", MAIN), ("part.mod", PART)):
        (tmp_path / name).write_bytes(text)
        output = tmp_path / name.replace(".", ".compensated.")
        stamp = stamp_line("1.0", "m", Source(name, text), "!") if stamped else b""
        first, _, rest = text.partition(b"\n")
        output.write_bytes(first + b"\n" + stamp + rest)
        sidecar_path(output).write_text("{}")
    assert set(names_in(tmp_path / "main.mod", FolderListing())[0]) == {"part.mod"}


@pytest.mark.parametrize("changed", [True, False])
@pytest.mark.parametrize("end", ["", ".compensated"])
def test_outputs_are_modules_of_an_output(tmp_path, end, changed):
    for name, text in (("main.mod", MAIN), ("part.mod", PART), ("same.mod", PART)):
        source = tmp_path / name
        source.write_bytes(text)
        if name != "same.mod":
            stamp = stamp_line("1.0", "m", Source(name, text), "!")
            first, _, rest = text.partition(b"\n")
            output = source.with_stem(source.stem + end)
            own = stamp if changed or name == "part.mod" else b""
            output.write_bytes(first + b"\n" + own + rest)
            sidecar_path(output).write_text("{}")
    found = names_in(tmp_path / f"main{end}.mod", FolderListing())[0]
    assert set(found) == {f"part{end}.mod", "same.mod"}
    if not end:
        pages = find_pages(tmp_path / "main.mod").paths
        assert {path.name for path in pages} == {"part.mod", "same.mod"}


def test_a_module_with_such_a_name_and_no_record_is_one(tmp_path):
    for name, text in (("main.mod", MAIN), ("part.compensated.mod", PART)):
        (tmp_path / name).write_bytes(text)
    assert set(names_in(tmp_path / "main.mod", FolderListing())[0]) == {
        "part.compensated.mod"
    }


POINTS = b"DEFDAT points PUBLIC\nDECL GLOBAL E6POS XGRIP={X 1}\nENDDAT\n"
EMPTY = b"DEF points( )\nEND\n"
USER = b"DEF job( )\nPTP xgrip\nEND\n"
LISTS = {
    "of a source without moves": ({}, True),
    "of a program that moves": (
        {"points.src": b"DEF points( )\n PTP XGRIP\nEND\n"}, False),
    "not public": ({"points.dat": POINTS.replace(b" PUBLIC", b"")}, False),
    "not global": ({"points.dat": POINTS.replace(b" GLOBAL", b"")}, False),
    "of numbers": ({"points.dat": POINTS.replace(b"E6POS", b"INT")}, False),
    "not named": ({"job.src": USER.replace(b"xgrip", b"xgrip2")}, False),
    "not named in code": ({"job.src": b"DEF job( )\nPTP XP1 ;grip\nEND\n"}, False),
}  # fmt: skip


@pytest.mark.parametrize(("other", "named"), LISTS.values(), ids=LISTS)
def test_lists_with_points_for_all_programs(tmp_path, other, named):
    files = {"job.src": USER, "points.src": EMPTY, "points.dat": POINTS}
    for name, text in {**files, **other}.items():
        (tmp_path / name).write_bytes(text)
    wanted = names_in(tmp_path / "job.src", FolderListing())[0]
    assert ("points.src" in wanted) == named
    assert not named or wanted["points.src"] == 2
    pages = find_pages(tmp_path / "job.src").paths
    assert ({p.name for p in pages} == {"points.src", "points.dat"}) == named


def test_a_list_needs_no_source(tmp_path):
    for name, text in (("job.src", USER), ("points.dat", POINTS)):
        (tmp_path / name).write_bytes(text)
    assert [p.name for p in find_pages(tmp_path / "job.src").paths] == ["points.dat"]
    (tmp_path / "other.src").write_bytes(USER.replace(b"job", b"other"))
    assert find_pages(tmp_path / "job.src").paths == ()


def test_points_that_several_programs_go_to_belong_to_none(tmp_path):
    for name, text in (
        ("job.src", USER), ("other.src", USER.replace(b"job", b"other")),
        ("points.src", EMPTY), ("points.dat", POINTS),
    ):  # fmt: skip
        (tmp_path / name).write_bytes(text)
    assert find_pages(tmp_path / "job.src").paths == ()


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        ("a>p a>r p>r", "a>p,r"),
        ("a>p p>q p>r q>r", "a>p,q,r"),
        ("a>p b>p p>q", "a> b> p>q"),
        ("a>u a>v b>u b>v u>p v>p p>q", "a> b> p>q u> v>"),
        ("a>p b>q p>r q>r r>s r>t s>t", "a>p b>q r>s,t"),
        ("a>b b>a", "a> b>"),
        ("a>b b>c c>b", "a>b,c"),
        ("a>a a>p", "a>p"),
    ],
)
def test_a_page_belongs_to_the_only_program_that_leads_to_it(named, expected):
    pairs = [pair.split(">") for pair in named.split()]
    graph = {name: [] for name in sorted({name for pair in pairs for name in pair})}
    for user, page in pairs:
        graph[user].append(page)
    found = group_pages(graph)
    assert " ".join(f"{k}>{','.join(v)}" for k, v in sorted(found.items())) == expected
