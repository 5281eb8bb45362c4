"""Stamps of KRL stand inside; what comes back from a controller is told."""

from __future__ import annotations

import re

import pytest

from postproc.language.text.source import Source
from postproc.language.text.stamp import (
    is_stamped,
    read_stamp,
    stamp_line,
    stamp_place,
    strip_stamp,
)
from tests.language.neutral_job import LANGUAGES, drawn
from tests.written import Desk, cli

HEADS = [
    b"&ACCESS RVP\r\n&REL 3\r\nDEF job( )\r\n",
    b"&ACCESS RVP\r\nDEFDAT job PUBLIC\r\n",
    b"; a line\n\nDEF  job ( )  ; more\n",
    b"global def job(a:IN)\n",
    b"DEFFCT INT job(a:IN)\n",
    b"\xef\xbb\xbfDEFDAT  $CONFIG\n",
    b"&ACCESS RVP\r\n; a line\r\n\r\nDEF job( )\r\n",
]


def stamp_of(source):
    return stamp_line("1.0", "abc", source, ";")


@pytest.mark.parametrize("head", HEADS)
def test_a_stamp_stands_behind_the_line_that_begins_a_routine(head):
    source = Source("job.src", head + b"PTP XP1\r\nEND\r\n")
    at = stamp_place(source.data)
    assert at == len(head)
    out = source.data[:at] + stamp_of(source) + source.data[at:]
    assert is_stamped(Source("job.src", out)) and read_stamp(out) is not None
    assert strip_stamp(out) == source.data


@pytest.mark.parametrize("place", [0, 1, 2])
def test_stamps_in_older_places_are_known(place):
    """In front of all, and behind the header, where they stood before."""
    source = Source("job.src", HEADS[0] + b"PTP XP1\r\nEND\r\n")
    lines = source.data.splitlines(keepends=True)
    at = len(b"".join(lines[: [0, 2, 3][place]]))
    out = source.data[:at] + stamp_of(source) + source.data[at:]
    assert read_stamp(out) is not None and strip_stamp(out) == source.data
    assert is_stamped(Source("job.src", out))


@pytest.fixture
def desk(job_folder, job_cell, tmp_path):
    """A compensated job, its source beside it."""
    text = (job_folder / "cell.toml").read_text()
    text = text.replace("[tool]", "absolute_accuracy = false\n[tool]")
    (tmp_path / "cell.toml").write_text(text)
    desk = Desk(tmp_path, tmp_path / "cell.toml", job_folder / "model.json")
    for name, data in LANGUAGES["job.src"](drawn(job_cell, 5, 12)).items():
        desk.put(name, data)
    (tmp_path / "out").mkdir()
    made = tmp_path / "out" / "job.src"
    assert desk.compensate(tmp_path / "job.src", "-o", made).exit_code in (0, 1)
    return desk


@pytest.mark.parametrize("name", ["job.src", "job.dat"])
def test_outputs_are_stamped_inside(desk, name):
    lines = (desk.folder / "out" / name).read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("DEF"))
    assert lines[first + 1].startswith("; postproc ")


def test_a_compensated_data_list_beside_its_source_is_refused(desk):
    source = (desk.folder / "job.dat").read_bytes()
    (desk.folder / "job.dat").write_bytes((desk.folder / "out/job.dat").read_bytes())
    again = desk.compensate(desk.folder / "job.src", "-o", desk.folder / "again.src")
    assert again.exit_code == 2 and "job.dat" in again.stderr
    assert "is compensated already" in again.stderr
    (desk.folder / "job.dat").write_bytes(source)
    again = desk.compensate(desk.folder / "job.src", "-o", desk.folder / "again.src")
    assert again.exit_code in (0, 1)


def counted(data):
    return re.sub(rb"&REL (\d+)", lambda m: b"&REL %d" % (int(m[1]) + 7), data)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data.replace(b"\r\n", b"\n"), "came back with other line ends"),
        (counted, "&REL was counted up from 1 to 8"),
        (lambda data: counted(data).replace(b"\r\n", b"\n"), "line ends, and its &REL"),
        (lambda data: data.replace(b"END", b"; x\r\nEND", 1), "was changed after"),
    ],
)
def test_what_a_controller_changes_is_told(desk, change, said):
    made = desk.folder / "out" / "job.src"
    made.write_bytes(change(made.read_bytes()))
    told = cli("restore", made)
    assert told.exit_code == 2 and said in told.stderr
