"""The record is only ever added to, whole at any moment, and refused in words."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sqlite3
import time
from pathlib import Path

import pytest

from postproc.exceptions import RecordError
from postproc.record.database import MIGRATIONS, TABLES, open_record
from postproc.record.rows import EventRow, ModelRow, RobotRow
from tests.slow import slow

ROBOT = RobotRow("R010", "nj220-2.7", "cell.toml", "", "2026-11-28T00:00:00")


def event(note: str) -> EventRow:
    return EventRow(None, "R010", "2026-11-28T00:00:00", "tool", "", note)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    with open_record(tmp_path / "plant.sqlite", create=True) as record:
        with record.writing():
            record.add(ROBOT)
            record.add(event("first"))
    return tmp_path / "plant.sqlite"


def test_what_was_added_is_read_back(place: Path) -> None:
    with open_record(place) as record:
        assert record.rows(RobotRow) == [ROBOT]
        (found,) = record.rows(EventRow, "R010")
        assert (found.id, found.note) == (1, "first")
        assert record.rows(EventRow, "R011") == []


@pytest.mark.parametrize("table", TABLES)
def test_nothing_is_deleted_and_only_states_change(place: Path, table: str) -> None:
    db = sqlite3.connect(place)
    model = ("m", "R010", "2026", "", None, "fitted", "m.json", None, "current", b"")
    db.execute("INSERT INTO model VALUES (?,?,?,?,?,?,?,?,?,?)", model)
    survey = (1, "R010", "2026", "check", "", "", "c.csv", "", b"", "")
    db.execute("INSERT INTO survey VALUES (?,?,?,?,?,?,?,?,?,?)", survey)
    verdict = (1, "R010", 1, "2026", 9, *[0.1] * 3, 1, *[1.0] * 4, "", 0.0)
    db.execute(f"INSERT INTO verdict VALUES ({','.join('?' * 15)})", verdict)
    program = (1, "R010", "a", "b", "m", "", "2026", None)
    db.execute("INSERT INTO program VALUES (?,?,?,?,?,?,?,?)", program)
    with pytest.raises(sqlite3.IntegrityError, match="only ever added"):
        db.execute(f"DELETE FROM {table}")
    with pytest.raises(sqlite3.IntegrityError, match="only ever added"):
        db.execute(f"UPDATE {table} SET serial = 'R099'")
    db.execute("UPDATE model SET state = 'superseded'")
    db.execute("UPDATE program SET moves_mm = 0.2")
    db.execute("UPDATE robot SET state = 'replaced by R011'")


def test_what_fails_in_the_middle_leaves_nothing(place: Path) -> None:
    with open_record(place) as record:
        with pytest.raises(RuntimeError), record.writing():
            record.add(event("half"))
            raise RuntimeError("stopped")
        assert [e.note for e in record.rows(EventRow)] == ["first"]
        with pytest.raises(RecordError, match="robot show"), record.writing():
            record.add(ModelRow("m", "R099", "", "", None, "", "", None, "", b""))


def test_a_bare_copy_of_an_open_record_has_all_that_was_closed(place: Path) -> None:
    copy = place.with_name("copy.sqlite")
    with open_record(place) as record, open_record(place) as other:
        for k in range(5):
            with record.writing():
                record.add(event(f"{k}"))
            shutil.copyfile(place, copy)  # without what may lie beside it
            with open_record(copy) as copied:
                assert len(copied.rows(EventRow)) == k + 2
        assert len(other.rows(EventRow)) == 6


def _write(place: Path, name: str, count: int) -> None:
    with open_record(place) as record:
        for k in range(count):
            with record.writing():
                record.add(event(f"{name}{k}"))


def test_two_writers_at_once_lose_nothing(place: Path) -> None:
    context = multiprocessing.get_context("spawn")
    each = [context.Process(target=_write, args=(place, n, 15)) for n in "ab"]
    for one in each:
        one.start()
    for one in each:
        one.join(60)
        assert one.exitcode == 0
    with open_record(place) as record:
        notes = {e.note for e in record.rows(EventRow)}
    assert notes == {"first", *(f"{n}{k}" for n in "ab" for k in range(15))}


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="there are no kills")
@pytest.mark.parametrize("count", [3, *slow([100])])
def test_a_kill_leaves_it_readable_and_complete(place: Path, count: int) -> None:
    context = multiprocessing.get_context("spawn")
    for k in range(count):
        writer = context.Process(target=_write, args=(place, f"k{k}-", 100_000))
        writer.start()
        begun, seen = time.monotonic(), 0
        while seen < 1 + k % 5 and time.monotonic() - begun < 30:
            with open_record(place) as record:
                notes = [e.note for e in record.rows(EventRow)]
            seen = sum(note.startswith(f"k{k}-") for note in notes)
        assert writer.pid is not None
        os.kill(writer.pid, signal.SIGKILL)
        writer.join()
        with open_record(place) as record:
            after = [e.note for e in record.rows(EventRow)]
        own = [n for n in after if n.startswith(f"k{k}-")]
        assert own == [f"k{k}-{m}" for m in range(len(own))]  # no hole
        assert set(notes) <= set(after)


def test_other_files_are_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"does not exist.*robot add"):
        with open_record(tmp_path / "none.sqlite"):
            pass
    text = tmp_path / "text.sqlite"
    text.write_text("no database\n" * 200)
    with pytest.raises(RecordError, match="no record of robots"), open_record(text):
        pass
    other = tmp_path / "other.sqlite"
    sqlite3.connect(other).execute("CREATE TABLE a (b)").connection.commit()
    with pytest.raises(RecordError, match="no record of robots"), open_record(other):
        pass


def test_a_newer_record_is_refused_and_an_older_one_is_brought_here(
    place: Path,
) -> None:
    db = sqlite3.connect(place)
    db.execute(f"PRAGMA user_version = {len(MIGRATIONS) + 1}").connection.commit()
    db.close()
    with pytest.raises(RecordError, match="newer"), open_record(place):
        pass
    older = place.with_name("older.sqlite")
    sqlite3.connect(older).close()  # version 0: no tables yet
    with open_record(older) as record:
        assert record.rows(RobotRow) == []


def test_a_torn_copy_is_refused(place: Path) -> None:
    with open_record(place) as record:
        for k in range(200):
            with record.writing():
                record.add(event("x" * 200 + str(k)))
    content = bytearray(place.read_bytes())
    content[8192:12288] = os.urandom(4096)
    place.write_bytes(bytes(content))
    with (
        pytest.raises(RecordError, match=r"damaged|copied"),
        open_record(place) as torn,
    ):
        torn.rows(EventRow)


def test_a_backup_is_the_record(place: Path) -> None:
    copy = place.with_name("copy.sqlite")
    with open_record(place) as record:
        record.back_up(copy)
        with open_record(copy) as copied:
            assert copied.rows(EventRow) == record.rows(EventRow)


def test_a_full_disk_is_told(place: Path) -> None:
    from postproc.exceptions import DiskFullError

    with open_record(place) as record:
        record.db.execute("PRAGMA max_page_count = 30")
        with pytest.raises(DiskFullError, match="room"):
            for _ in range(100):
                with record.writing():
                    record.add(event("x" * 4000))
        before = len(record.rows(EventRow))
    with open_record(place) as record:
        assert len(record.rows(EventRow)) == before
