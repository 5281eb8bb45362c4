"""Tables: units survive, markup is text, control characters are shown."""

from __future__ import annotations

import io
import threading

from postproc.cli.common import stages, suggest
from postproc.exceptions import printable
from postproc.report.terminal import (
    PLAIN_WIDTH,
    Column,
    fold_cells,
    lay_out_message,
    print_table,
    progress_bar,
    show_status,
    stage_bar,
    table_text,
)


class Screen(io.StringIO):
    def isatty(self):
        return True


def test_cells_and_titles_are_never_markup():
    text = table_text(
        [Column("x [mm]"), Column("name", "left")], [["1.0", "[red]a[/]"]]
    )
    head, row = text.splitlines()
    assert head.split() == ["x", "[mm]", "name"] and row.split() == ["1.0", "[red]a[/]"]


def test_columns_are_aligned_as_asked():
    rows = [["1", "a"], ["100", "bbb"]]
    lines = table_text([Column("n"), Column("name", "left")], rows).splitlines()
    assert [
        line.index(end) for line, end in zip(lines[1:], ("a", "b"), strict=True)
    ] == [lines[0].index("name")] * 2
    assert lines[1].startswith("  1") and lines[2].startswith("100")


def test_control_characters_cannot_steer_the_terminal():
    out = Screen()
    print_table([Column("name")], [["\x1b[2Jgone\r"]], out=out)
    assert "\x1b[2J" not in out.getvalue() and "\\x1b[2Jgone\\r" in out.getvalue()
    assert printable("Br\xfccke 'a'\t") == "Br\xfccke 'a'\\t"


def test_long_tables_are_not_cut_in_a_pipe():
    rows = [[str(i), "x" * 40, "y" * 40, "z" * 40] for i in range(300)]
    text = table_text([Column(c) for c in "abcd"], rows)
    assert len(text.splitlines()) == 301 and "\u2026" not in text


def test_a_long_cell_is_folded_at_words_and_nothing_is_cut():
    columns = [Column("a", "left"), Column("added", "left"), Column("rows")]
    told = " ".join(["backlash"] * 50)
    rows = [["model", told, "12"], ["b", "", "7"]]
    head, *lines = table_text(columns, fold_cells(columns, rows, "added")).splitlines()
    assert len(head) == len(lines[0]) == PLAIN_WIDTH
    assert " ".join(lines).split() == ["model", *told.split()[:20], "12",
                                       *told.split()[20:], "b", "7"]  # fmt: skip
    assert max(map(len, lines)) == PLAIN_WIDTH
    findings = table_text([*columns[:1], columns[2]], [["backlash", told]])
    assert findings.splitlines()[1] == f"backlash  {told}"


def test_nothing_of_progress_reaches_a_pipe():
    pipe = io.StringIO()
    with stages(pipe) as told, progress_bar("work", pipe) as done:
        told("parse")
        done(1, 2)
    with stage_bar(pipe) as share_of:
        share_of("parse", 0.5)
    assert pipe.getvalue() == ""


def test_what_lasts_is_shown_on_a_terminal(monkeypatch):
    shown, screen = threading.Event(), Screen()

    def show(out, text):
        update, hide = show_status(out, text)
        shown.set()
        return update, hide

    monkeypatch.setattr("postproc.cli.common.PATIENCE", 0.0)
    monkeypatch.setattr("postproc.report.terminal.show_status", show)
    with stages(screen) as told:
        told("plan [1]")
        assert shown.wait(60)
    assert screen.getvalue()
    monkeypatch.setattr("postproc.cli.common.PATIENCE", 60.0)
    quick = Screen()
    with stages(quick) as told:
        told("plan")
    assert quick.getvalue() == ""


def test_progress_shows_on_a_terminal():
    screen = Screen()
    with progress_bar("copying [all]", screen) as done:
        done(3, 4)
    assert "copying [all]" in screen.getvalue()


def test_stages_show_with_how_far_the_job_is():
    screen = Screen()
    with stage_bar(screen) as told:
        told("look for effect [2]", 0.25)
    assert "look for effect [2]" in screen.getvalue()
    assert "\u2501" in screen.getvalue()


def test_a_log_is_told_the_stages_of_what_lasts(monkeypatch):
    clock = iter([0.0, 5.0, 30.0, 0.0, 21.0])
    monkeypatch.setattr("postproc.report.terminal.monotonic", lambda: next(clock))
    log = io.StringIO()
    with stages(log, log=True) as told:
        told("read")
        told("fit")
    assert log.getvalue() == "30 s: fit\n"
    with stage_bar(log) as share_of:
        share_of("candidates", 0.5)
    assert log.getvalue() == "30 s: fit\n21 s: candidates\n"


FINDING = (
    "job.pdl:506: direction-uncertain: the approach direction is uncertain, because "
    "axis 5 reversed shortly before: start the approach 37 mm farther back"
)


def test_messages_fit_a_terminal_and_lose_no_word(monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    text = lay_out_message(FINDING + "\n    506 | MOVE LINEAR TO " + "x" * 90, Screen())
    *lines, excerpt = text.splitlines()
    assert max(map(len, lines)) <= 80 and len(lines) == 2
    assert " ".join(line.strip() for line in lines) == FINDING
    assert excerpt == "    506 | MOVE LINEAR TO " + "x" * 90


def test_a_finding_has_the_colour_of_its_severity(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    shown = {
        lead: lay_out_message(f"{lead}so it is", Screen())
        for lead in ("a.pdl:1: conflict: ", "a.pdl:1: direction-uncertain: ",
                     "a.pdl:1: no-such-code: ", "postproc: ", "written ")
    }  # fmt: skip
    assert "\x1b[33mdirection-uncertain" in shown["a.pdl:1: direction-uncertain: "]
    assert "\x1b[31mpostproc: " in shown["postproc: "]
    for plain in ("a.pdl:1: no-such-code: ", "written "):
        assert "\x1b" not in shown[plain]


def test_the_next_command_is_shown_on_a_terminal_only(monkeypatch):
    screen = Screen()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("NO_COLOR", "1")
    suggest("compensate", "PROGRAM", cell="cell.toml", model=None)
    assert screen.getvalue() == "next: postproc compensate PROGRAM --cell cell.toml\n"
    pipe = io.StringIO()
    monkeypatch.setattr("sys.stderr", pipe)
    suggest("compensate", "PROGRAM")
    assert pipe.getvalue() == ""


def test_stages_show_the_time_that_is_left():
    out = Screen()
    with stage_bar(out) as told:
        told("search", 0.5)
    assert ":--" in out.getvalue() or "0:00" in out.getvalue()
