"""The record of robots: one SQLite file that is only ever added to."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import TypeVar

from postproc.exceptions import DiskFullError, RecordError
from postproc.operating_system import is_shared_disk
from postproc.record.rows import STATES, Row

NAME = "plant.sqlite"
PATIENCE = 10.0  # [s] that a writer waits for another one
MAKE = "Make one with postproc robot add"
COPIED = "Take a copy with postproc robot backup; restore the newest one"
R = TypeVar("R", bound=Row)

# The tables, as they came to be: the number of a record's version is how many of these
# it has had.

MIGRATIONS = (
    """
    CREATE TABLE robot (
        serial TEXT PRIMARY KEY, arm TEXT NOT NULL, cell TEXT NOT NULL,
        line TEXT NOT NULL, added TEXT NOT NULL, state TEXT NOT NULL);
    CREATE TABLE survey (
        id INTEGER PRIMARY KEY, serial TEXT NOT NULL REFERENCES robot,
        date TEXT NOT NULL, kind TEXT NOT NULL, operator TEXT NOT NULL,
        instrument TEXT NOT NULL, file TEXT NOT NULL, sha256 TEXT NOT NULL,
        content BLOB NOT NULL, program TEXT NOT NULL);
    CREATE TABLE event (
        id INTEGER PRIMARY KEY, serial TEXT NOT NULL REFERENCES robot,
        date TEXT NOT NULL, kind TEXT NOT NULL, joints TEXT NOT NULL,
        note TEXT NOT NULL);
    CREATE TABLE model (
        id TEXT NOT NULL, serial TEXT NOT NULL REFERENCES robot, date TEXT NOT NULL,
        parent TEXT NOT NULL, survey INTEGER REFERENCES survey, origin TEXT NOT NULL,
        file TEXT NOT NULL, left_mm REAL, state TEXT NOT NULL, content BLOB NOT NULL,
        PRIMARY KEY (serial, id));
    CREATE TABLE verdict (
        id INTEGER PRIMARY KEY, serial TEXT NOT NULL REFERENCES robot,
        survey INTEGER NOT NULL REFERENCES survey, date TEXT NOT NULL,
        n INTEGER NOT NULL, mean_mm REAL NOT NULL, within_mm REAL NOT NULL,
        worst_mm REAL NOT NULL, in_control INTEGER NOT NULL,
        statistic REAL NOT NULL, statistic_limit REAL NOT NULL, drift REAL NOT NULL,
        drift_limit REAL NOT NULL, moved TEXT NOT NULL, nats REAL NOT NULL);
    CREATE TABLE program (
        id INTEGER PRIMARY KEY, serial TEXT NOT NULL REFERENCES robot,
        path TEXT NOT NULL, output TEXT NOT NULL, model TEXT NOT NULL,
        sha256 TEXT NOT NULL, released TEXT NOT NULL, moves_mm REAL);
    CREATE INDEX survey_of ON survey (serial);
    CREATE INDEX event_of ON event (serial);
    CREATE INDEX verdict_of ON verdict (serial);
    CREATE INDEX program_of ON program (serial);
    """,
)
TABLES = ("robot", "survey", "event", "model", "verdict", "program")


@dataclass(frozen=True, eq=False)
class Record:
    """An open record.

    Attributes:
        path: Its file.
        db: The connection.
    """

    path: Path
    db: sqlite3.Connection

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Write what belongs together: all of it, or nothing.

        What is written then stands in the file itself, not beside it: a bare copy of
        the file has all of it.

        Raises:
            RecordError: The record cannot be written, or is only ever added to.
            DiskFullError: There is no room.
        """
        with _in_words(self.path):
            self.db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self.db.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):
                    self.db.execute("ROLLBACK")
                raise
            self.db.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def add(self, row: Row) -> int:
        """Add a row inside of `writing`; return its number."""
        names = [f.name for f in fields(row)]
        places = ", ".join("?" * len(names))
        sql = f"INSERT INTO {row.table} ({', '.join(names)}) VALUES ({places})"
        return int(self.db.execute(sql, astuple(row)).lastrowid or 0)

    def set_state(self, row: Row, **states: object) -> None:
        """Change states of a row inside of `writing`; nothing else may change."""
        key = "serial" if row.table == "robot" else "id"
        set_ = ", ".join(f"{name} = ?" for name in states)
        sql = f"UPDATE {row.table} SET {set_} WHERE {key} = ? AND serial = ?"
        self.db.execute(sql, (*states.values(), getattr(row, key), row.serial))

    def rows(self, kind: type[R], serial: str | None = None) -> list[R]:
        """Return all rows of a table, or those of a robot, as they were added."""
        names = ", ".join(f.name for f in fields(kind))
        where, given = ("", ()) if serial is None else (" WHERE serial = ?", (serial,))
        sql = f"SELECT {names} FROM {kind.table}{where} ORDER BY rowid"
        with _in_words(self.path):
            return [kind(*found) for found in self.db.execute(sql, given)]

    def back_up(self, copy: Path) -> None:
        """Write a copy of the record, whole as it is at one moment.

        Raises:
            RecordError: The copy cannot be written.
        """
        with _in_words(copy):
            other = sqlite3.connect(copy)
            try:
                self.db.backup(other)
            finally:
                other.close()


@contextmanager
def open_record(path: Path, create: bool = False) -> Iterator[Record]:
    """Open a record, and bring an older one to this version.

    Args:
        path: Its file.
        create: Whether to make it where there is none.

    Raises:
        RecordError: There is none, it is no record, of a newer version, or damaged.
    """
    if not create and not path.exists():
        raise RecordError(path, "does not exist", MAKE)
    with _in_words(path):
        db = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
        try:
            _prepare(db, path)
            yield Record(path, db)
        finally:
            db.close()


def _prepare(db: sqlite3.Connection, path: Path) -> None:
    """Check the file, set how it is written, and bring it to this version."""
    db.execute("PRAGMA foreign_keys = ON")
    version = int(db.execute("PRAGMA user_version").fetchone()[0])
    if version > len(MIGRATIONS):
        cure = "Use the version of postproc that wrote it, or a newer one"
        raise RecordError(path, f"is of version {version}, which is newer", cure)
    held = db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    if version == 0 and held:
        raise RecordError(path, "is no record of robots", "Name another file")
    if db.execute("PRAGMA quick_check(1)").fetchone()[0] != "ok":
        raise RecordError(
            path, "is damaged, or was copied while it was written", COPIED
        )
    journal = "DELETE" if is_shared_disk(path) else "WAL"
    db.execute(f"PRAGMA journal_mode = {journal}")
    db.execute("PRAGMA synchronous = FULL")
    if version < len(MIGRATIONS):
        _migrate(db)


def _migrate(db: sqlite3.Connection) -> None:
    """Make the tables that a record does not have yet, in one transaction."""
    db.execute("BEGIN IMMEDIATE")
    version = int(db.execute("PRAGMA user_version").fetchone()[0])
    for text in MIGRATIONS[version:]:
        for one in filter(str.strip, text.split(";")):
            db.execute(one)
    for table in TABLES:
        for one in _guards(db, table):
            db.execute(one)
    db.execute(f"PRAGMA user_version = {len(MIGRATIONS)}")
    db.execute("COMMIT")


def _guards(db: sqlite3.Connection, table: str) -> Iterator[str]:
    """Yield the triggers that refuse to delete rows, and to change all but states."""
    names = [row[1] for row in db.execute(f"PRAGMA table_info({table})")]
    fixed = [n for n in names if n not in STATES.get(table, ())]
    changed = " OR ".join(f"OLD.{n} IS NOT NEW.{n}" for n in fixed)
    refuse = f"SELECT RAISE(ABORT, 'rows of {table} are only ever added')"
    for name, when in (("delete", ""), ("update", f" WHEN {changed}")):
        yield f"DROP TRIGGER IF EXISTS no_{name}_{table}"
        yield (
            f"CREATE TRIGGER no_{name}_{table} BEFORE {name.upper()} ON {table}"
            f"{when} BEGIN {refuse}; END"
        )


@contextmanager
def _in_words(path: Path) -> Iterator[None]:
    """Say what SQLite refuses with the file and a cure.

    Raises:
        RecordError: It does.
        DiskFullError: There is no room on the disk.
    """
    try:
        yield
    except sqlite3.Error as exc:
        code = getattr(exc, "sqlite_errorname", "")
        if code.startswith("SQLITE_FULL"):
            raise DiskFullError(path, "no room on the disk", "Make room") from None
        if code.startswith("SQLITE_BUSY"):
            problem, cure = "is being written by another process", "Try again"
        elif code.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB")):
            problem, cure = "is damaged, or no record of robots", COPIED
        elif code.startswith("SQLITE_CONSTRAINT"):
            problem, cure = str(exc), "See what it holds with postproc robot show"
        else:
            problem, cure = f"cannot be used: {exc}", "Check the place and its rights"
        raise RecordError(path, problem, cure) from None
