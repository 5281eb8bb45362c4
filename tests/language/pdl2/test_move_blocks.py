"""Stretches of moves that are run at once do what their lines do one by one."""

import random

import numpy as np
import pytest

from postproc.diagnostics import Code
from postproc.language.language import Start
from postproc.language.pdl2.interpreter import resolve
from postproc.language.pdl2.move_blocks import MoveBlocks
from postproc.language.pdl2.program import parse
from postproc.language.pdl2.variable_file import read_variables
from postproc.language.text.source import source_from_bytes
from postproc.language.visits import Visits

PROGRAMS = 120
START = Start(
    aux={1: "gun", 2: "track"},
    routines={"moves_it": "moves", "sets_it": "sets-frames"},
    frame_tables={"fra": {"1": {"tool": (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)}}},
    taught=frozenset({"wp_6"}),
)
POINTS = "WP_1 WP_2 WP_3 wp_4 WP_5 WP_6 pts[1] PTS[2] pts[7] jp1 gone2 n1 VV".split()
CALLS = (
    "spot(1, 2, FALSE)", "spot2(3)", "spot(n1)", "spot(WP_1)", "own", "fra(1)",
    "moves_it", "sets_it", "err_trap_on(39960)", "bit_set(n1, 1)", "sensor_on(2)",
    "own2(WP_2, 3)", "CALL away", "atan2(1, 2)", "spot(pts)",
)  # fmt: skip
SETTINGS = (
    "$LIN_SPD := 0.1", "$MOVE_TYPE := LINEAR", "$MOVE_TYPE := JOINT", "n1 := 2",
    "$MOVE_TYPE := n1", "WP_2 := WP_3", "WP_1.x := 4", "pts[2] := jp1", "$TOOL := WP_3",
    "WP_5 := POS(1, 2, 3, 4, 5, 6, 'S')",
)  # fmt: skip
WITH = (
    "", "", "", " ADVANCE", " WITH $LIN_SPD = 0.05", " WITH $LIN_SPD = 0.2",
    " WITH $FLY_DIST = 5, $LIN_SPD = 0.1", " WITH $LIN_SPD = n1", " TIL $DIN[1]",
    " VIA WP_3", " WITH $MOVE_TYPE = 1", " -- TAUGHT", " -- MEASURE M{}",
)  # fmt: skip


class Writer:
    """Writes programs of moves to points, with what may come between them."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)

    def number(self) -> str:
        return f"{self.rng.uniform(-900, 900):.3f}"

    def move(self) -> str:
        six = ", ".join(self.number() for _ in range(6))
        to = self.rng.choice([*POINTS, f"POS({six}, 'W T1:0')", f"{{{six}}}"])
        words = self.rng.choice(["", "JOINT ", "LINEAR "])
        move = f"{self.rng.choice(['MOVE', 'MOVEFLY'])} {words}TO {to}"
        if self.rng.random() < 0.3:
            call = self.rng.choice(CALLS[:-4])
            return f"{move} ,\n WITH CONDITION[{call}],\n ENDMOVE"
        return move + self.rng.choice(WITH).format(self.rng.randrange(9))

    def lines(self, count: int, depth: int = 0) -> list[str]:
        kinds = [self.move] * 8
        kinds += [lambda: self.rng.choice(CALLS), lambda: self.rng.choice(SETTINGS)]
        lines = []
        for _ in range(count):
            if depth < 2 and self.rng.random() < 0.12:
                inner = self.lines(3, depth + 1)
                block = self.rng.choice(
                    [("IF $DIN[1] THEN", "ENDIF"), ("WHILE $DIN[1] DO", "ENDWHILE"),
                     ("FOR i := 1 TO 2 DO", "ENDFOR"), ("REPEAT", "UNTIL $DIN[1]")]
                )  # fmt: skip
                lines += [block[0], *inner, block[1]]
            else:
                lines.append(self.rng.choice(kinds)())
        return lines

    def program(self) -> str:
        handler = "CONDITION[1] :\nWHEN $DIN[1] DO\n WP_3 := WP_2\nENDCONDITION"
        return "\n".join(
            [
                "PROGRAM job",
                "VAR WP_1, WP_2, WP_3, wp_4 : XTNDPOS FOR ARM[1]",
                " WP_5 : POSITION EXPORTED FROM job",
                " WP_6 : POSITION := POS(6, 5, 4, 3, 2, 1, '')",
                " pts : ARRAY[9] OF POSITION",
                " jp1 : JOINTPOS FOR ARM[1]",
                " n1, i : INTEGER",
                " VV : VECTOR",
                "ROUTINE own2(WP_4 : POSITION; n : INTEGER)",
                *("BEGIN", *self.lines(3, 2), "END own2"),
                "ROUTINE own",
                *("VAR WP_1 : POSITION", "BEGIN", *self.lines(3, 2), "END own"),
                "BEGIN",
                *([handler] if self.rng.random() < 0.3 else []),
                *self.lines(14),
                "END job",
            ]
        )

    def values(self) -> str:
        lines = []
        for name in ("WP_1", "WP_2", "WP_3", "wp_4", "WP_5", "gone2"):
            if self.rng.random() < 0.9:
                six = " ".join(f"{x}: {self.number()}" for x in "XYZAER")
                aux = self.rng.choice(["", " 1: 22", " 1: 3 2: 4"])
                head = self.rng.choice(["XTND Arm: 1 Ax:1 Priv", "POS Xport"])
                lines += [f"{name} {head}", f" {six}{aux}", " CNFG: 'S'"]
        lines += [
            "pts APOS [9] Priv",
            *(f" [{k}]: X:{k} Y:2 Z:3 A:4 E:5 R:6" for k in (1, 2)),
        ]
        return "\n".join([*lines, "jp1 JNTP Priv", "1: 1 2: 2 3: 3 4: 4 5: 5 6: 6"])


def told(visits: Visits) -> list[object]:
    """List what is said of every visit, the tables' texts instead of their indices."""
    v = visits
    texts = (
        (v.target.config, v.target.configs),
        (v.target.name, v.target.names),
        (v.reason, v.reasons),
    )
    frames = np.concatenate([v.frame.poses, np.full((1, 4, 4), np.nan)])
    return [
        *([table[k] for k in column.tolist()] for column, table in texts),
        *(
            repr(frames[k].tolist())
            for k in (v.frame.tool, v.frame.base, v.frame.uframe)
        ),
        *(
            repr(v.columns[name].tolist())
            for name in "line kind meaning via values distance_mm aux config_given "
            "literal follows fly size_mm linear".split()
        ),
        repr((v.graph.pred_start.tolist(), v.graph.pred.tolist())),
        v.place.measure_id,
        *(repr(getattr(v.literals, n)) for n in ("line", "places", "name", "pinned")),
        *(v.literals.taught.tolist(), v.literals.shared.tolist()),
    ]


@pytest.mark.parametrize("seed", range(PROGRAMS))
def test_at_once_is_as_one_by_one(seed, monkeypatch) -> None:
    writer = Writer(seed)
    text, values = writer.program(), writer.values()

    def read():
        program = parse(source_from_bytes("job.pdl", text.encode()))
        variables = read_variables(source_from_bytes("job.lsv", values.encode()))
        return resolve(program, START, variables if seed % 4 else None)

    found = read()
    monkeypatch.setattr(MoveBlocks, "run", lambda self, here: False)
    wanted = read()
    assert told(found.visits) == told(wanted.visits), text
    assert found.diagnostics == wanted.diagnostics, text


def test_most_moves_of_a_spot_job_are_run_at_once(monkeypatch) -> None:
    ran = []
    run = MoveBlocks.run

    def counted(self, here):
        first, done = here.row, run(self, here)
        ran.append(here.row - first)
        return done

    monkeypatch.setattr(MoveBlocks, "run", counted)
    spots = "\n".join(
        f"MOVE TO WP_{k} , \n WITH CONDITION[spot(1, {k})],\nENDMOVE" for k in range(50)
    )
    declared = ", ".join(f"WP_{k}" for k in range(50))
    text = f"PROGRAM a\nVAR {declared} : XTNDPOS\nBEGIN\n{spots}\nEND a"
    found = resolve(parse(source_from_bytes("a.pdl", text.encode())))
    assert len(found.visits) == 50 and ran == [50]


def test_moves_that_are_looked_at_twice_are_listed_once() -> None:
    text = (
        "PROGRAM a\nVAR n : INTEGER\nBEGIN\n$MOVE_TYPE := LINEAR\nREPEAT\n"
        "MOVE TO POS(1, 2, 3, 4, 5, 6, '')\nMOVE TO POS(2, 2, 3, 4, 5, 6, '')\n"
        "$MOVE_TYPE := n\nUNTIL $DIN[1]\nEND a"
    )
    visits = resolve(parse(source_from_bytes("a.pdl", text.encode()))).visits
    assert visits.place.line.tolist() == [6, 7]
    assert all(
        "known only at run time" in visits.reasons[k].text for k in visits.reason
    )


def test_a_number_that_cannot_be_read_is_told_between_blocks() -> None:
    six = "POS({}, 2, 3, 4, 5, 6, '')"
    places = [six.format(k) for k in (1, "1e999", 2, 3, 4, 5, 6)]
    moves = "\n".join(f"MOVE LINEAR TO {place}" for place in places)
    text = f"PROGRAM a\nBEGIN\n{moves}\nEND a"
    found = resolve(parse(source_from_bytes("a.pdl", text.encode()))).visits
    codes = [found.reasons[k].code for k in found.reason.tolist()]
    assert codes[1] is Code.UNREADABLE_NUMBER
    assert Code.UNREADABLE_NUMBER not in codes[2:7]


def test_a_file_of_one_point_stands_beside_points_that_are_assigned() -> None:
    given = "\n".join(f"p{k} := POS({k}, 2, 3, 4, 5, 6, '')" for k in range(3))
    moves = "\n".join(f"MOVE TO {name}" for name in ("w", "p0", "w", "p1", "p2", "w"))
    text = f"PROGRAM a\nVAR w, p0, p1, p2 : POSITION\nBEGIN\n{given}\n{moves}\nEND a"
    values = b"w POS Priv\n X: 9 Y: 8 Z: 7 A: 6 E: 5 R: 4\n CNFG: ''\n"
    variables = read_variables(source_from_bytes("a.lsv", values))
    found = resolve(parse(source_from_bytes("a.pdl", text.encode())), None, variables)
    assert found.visits.target.values[:, 0].tolist() == [9, 0, 9, 1, 2, 9]


ROUNDS = """PROGRAM job
VAR i : INTEGER
  p : POSITION
BEGIN
p := POS(1, 2, 3, 4, 5, 6, '')
FOR i := 1 TO 9 DO
{}
ENDFOR
END job"""
INLINE = [f"MOVE LINEAR TO POS({k}, 2, 3, 4, 5, 6, '')" for k in range(5)]


@pytest.mark.parametrize(
    ("more", "reads"), [("", 1), ("spot(1, 2, FALSE)", 9), ("MOVE LINEAR TO p", 9)]
)
def test_a_block_of_written_moves_is_read_once_in_all_rounds(
    more: str, reads: int, monkeypatch: pytest.MonkeyPatch
):
    read, blocks = MoveBlocks._read, []

    def note(self, *given):
        blocks.append(read(self, *given))
        return blocks[-1]

    monkeypatch.setattr(MoveBlocks, "_read", note)
    text = ROUNDS.format("\n".join([*INLINE, more, *INLINE]))
    found = resolve(parse(source_from_bytes("job.pdl", text.encode()))).visits
    assert len(blocks) == reads
    assert len(found) == 9 * (10 + more.startswith("MOVE"))
    assert found.target.values[:5, 0].tolist() == [0, 1, 2, 3, 4]
    before = [found.graph.predecessors(k).tolist() for k in range(1, len(found))]
    assert before == [[k - 1] for k in range(1, len(found))]
