"""What is no regular file is written through or refused."""

from __future__ import annotations

import os
import socket
import stat
import threading

import pytest

from postproc.batch.run import TargetTree
from postproc.exceptions import OutputError
from postproc.files import check_places, is_stream, write_all
from tests.pipes import reading
from tests.written import cli


def test_a_device_stays_a_device(device, tmp_path):
    write_all({device: b"lost", tmp_path / "kept": b"kept"})
    assert stat.S_ISCHR(device.stat().st_mode)
    assert (tmp_path / "kept").read_bytes() == b"kept"


def test_a_pipe_gets_the_bytes(pipe):
    with reading(pipe) as found:
        write_all({pipe: [b"a", b"b"]})
    assert found == [b"ab"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_pipe_that_nobody_reads_on_changes_no_file(pipe, tmp_path):
    thread = threading.Thread(target=lambda: os.close(os.open(pipe, os.O_RDONLY)))
    thread.start()
    with pytest.raises(OutputError, match="nobody reads it any more"):
        write_all({tmp_path / "a": b"x", pipe: bytes(10_000_000)})
    thread.join()
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_its_file_is_replaced(tmp_path, there):
    (tmp_path / "far").mkdir()
    real, link = tmp_path / "far/real", tmp_path / "link"
    if there:
        real.write_bytes(b"old")
        real.chmod(0o640)
    link.symlink_to("far/real")
    write_all({link: b"new"})
    assert link.is_symlink() and real.read_bytes() == b"new"
    assert not there or real.stat().st_mode & 0o777 == 0o640
    assert [p.name for p in (tmp_path / "far").iterdir()] == ["real"]


def test_a_link_to_an_input_is_an_input(tmp_path):
    source, link = tmp_path / "job.pdl", tmp_path / "out.pdl"
    source.write_bytes(b"x")
    link.symlink_to(source)
    with pytest.raises(OutputError, match="is an input"):
        check_places([link], [source])


def test_a_link_into_nowhere_is_refused(tmp_path):
    (tmp_path / "link").symlink_to("none/real")
    with pytest.raises(OutputError, match="folder does not exist"):
        write_all({tmp_path / "link": b"x"})


def test_a_socket_is_refused(tmp_path):
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        with pytest.raises(OutputError, match="neither a file nor a pipe"):
            write_all({tmp_path / "socket": b"x"})
    assert stat.S_ISSOCK((tmp_path / "socket").stat().st_mode)


def test_an_open_file_is_added_to(tmp_path):
    # `-o /dev/stdout >> log`: the log is no file of ours to replace.
    log = tmp_path / "log"
    log.write_bytes(b"before ")
    with log.open("ab") as out:
        place = tmp_path / "stdout"
        place.symlink_to(f"/proc/self/fd/{out.fileno()}")
        assert is_stream(place)
        write_all({place: b"after"})
    assert log.read_bytes() == b"before after"


def test_a_tree_of_outputs_holds_no_links(tmp_path):
    source = tmp_path / "source.pdl"
    source.write_bytes(b"nominal")
    (tmp_path / "dst").mkdir()
    (tmp_path / "dst/job.pdl").symlink_to(source)
    tree = TargetTree(tmp_path / "dst")
    with pytest.raises(OutputError, match="not replaced"):
        tree.write({"job.pdl": b"new"})
    with pytest.raises(OutputError, match="not replaced"):
        tree.copy(source, "job.pdl")
    assert source.read_bytes() == b"nominal"


def test_the_log_of_a_batch_is_a_file(desk, pipe):
    (desk.folder / "src").mkdir()
    given = ["--cell", desk.cell, "--model", desk.model, "-j", "1"]
    (desk.folder / "dst.batch.jsonl").symlink_to(pipe)
    found = cli("batch", desk.folder / "src", desk.folder / "dst", *given)
    assert found.exit_code == 2 and "Remove it, or name another DST" in found.stderr


def test_a_figure_goes_through_a_pipe(pipe):
    from matplotlib.figure import Figure

    from postproc.report.plots import save

    with reading(pipe) as found:
        save(Figure(), pipe)
    assert found[0].startswith(b"\x89PNG")
