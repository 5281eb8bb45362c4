"""One milled job of 20,000 targets in every language: processor time of every stage.

    python -m tests.bench.languages [--targets 20000] [--rounds 3]
    python -m tests.bench.languages --files [--targets 1000000]
    python -m tests.bench.languages --named [--targets 20000]
    python -m tests.bench.languages --inline-forms [--targets 20000]

The same moves in the same cell, one process, without cycle times. Languages take
turns; the fastest round of each counts.

`--named`: the time to read them where every target is a point of its own name, declared
in the module (RAPID), in the data list (KRL) or in the variable file (PDL2).

`--inline-forms`: the time to read them in KRL where every target is an inline form, as
the pendant writes them, with a point and data of its own.

`--files`: from files to written output and reports, by as many processes as there are
cores. The moves are one fly run; those of 20,000 targets are repeated.
"""

from __future__ import annotations

import argparse
import itertools
import json
import re
import shutil
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from postproc.compensation.compensate import compensate
from postproc.compensation.options import Options
from postproc.compensation.outcome import Status
from postproc.compensation.program import read_program
from postproc.model.model import Model
from postproc.robot.cell import Cell
from postproc.robot.trajectory import Motion
from tests.bench.memory import watched
from tests.bench.stages import STAGES
from tests.language.neutral_job import LANGUAGES, NeutralJob, NeutralMove, drawn
from tests.language.true_error import fitted

ARM = 56  # seed
ROW = 200  # targets of a milled row
ONCE = 20_000  # targets after which rows repeat
ROOT = Path(__file__).parents[2]
NAMES = {"job.pdl": "PDL2", "job.mod": "RAPID", "job.src": "KRL"}


def milled(cell: Cell, n: int) -> NeutralJob:
    """Return a job that goes there and back in rows, targets about 2 mm apart."""
    job = drawn(cell, 0)
    first, last = job.moves[0], job.moves[-1]
    k = np.arange(n)
    row, along = k // ROW, k % ROW
    along = np.where(row % 2, ROW - 1 - along, along)
    turned = np.outer(along - ROW / 2, [0.09, 0.0, 0.0, 0.01, 0.02, 0.03])
    turned += np.outer(row % 100, [0.0, 0.05, -0.05, 0.0, 0.03, 0.0])
    places = last.q + np.deg2rad(turned)
    lines = (NeutralMove(Motion.LINEAR, q, zone_mm=1.0) for q in places)
    return replace(job, moves=(first, *lines, last))


def written(job: NeutralJob) -> dict[str, Mapping[str, bytes]]:
    """Write a job in every language; a zone that stays is set once, as posts do."""
    again = re.compile(rb"(?<=\n)[ ]*(\$FLY_DIST := 1|\$APO\.CDIS=1)\r?\n")
    found: dict[str, Mapping[str, bytes]] = {}
    for name, write in LANGUAGES.items():
        texts = dict(write(job))
        begin = again.search(texts[name])
        if begin is not None:
            rest = again.sub(b"", texts[name][begin.end() :])
            texts[name] = texts[name][: begin.end()] + rest
        found[name] = texts
    return found


def measure(
    name: str, texts: Mapping[str, bytes], cell: Cell, model: Model
) -> dict[str, float]:
    """Compensate a job once, and return processor seconds of reading and of all."""
    others = {page: data for page, data in texts.items() if page != name}
    begin = time.process_time()
    program = read_program(texts, cell)
    read = time.process_time() - begin
    begin = time.process_time()
    done = compensate(
        texts[name], cell, model, options=Options(timing=False), name=name,
        pages=others, processes=1,
    )  # fmt: skip
    whole = time.process_time() - begin
    targets = len(program.visits)
    corrected = float(np.mean(done.decisions.status == Status.CORRECTED))
    return {"targets": targets, "read": read, "all": whole, "corrected": corrected}


def table(found: Mapping[str, dict[str, float]]) -> list[str]:
    """Write the table, times for a target."""
    one = {name: 1e6 / f["targets"] for name, f in found.items()}
    base = found["job.pdl"]["all"] * one["job.pdl"]
    rows = [
        "| language | targets | corrected | read, us a target | all, us a target | "
        "of PDL2's |",
        "|---|---|---|---|---|---|",
    ]
    for name, f in found.items():
        whole = f["all"] * one[name]
        rows.append(
            f"| {NAMES[name]} | {f['targets']:,} | {f['corrected']:.1%} | "
            f"{f['read'] * one[name]:.1f} | "
            f"{whole:.1f} | {whole / base:.2f} |"
        )
    return rows


# The same job with named points.

RAPID_TARGET = re.compile(r"MoveL (\[\[.*?9E9\]\]),")
KRL_TARGET = re.compile(r"SLIN (\{.*?\}) C_SPL")
PDL2_TARGET = re.compile(r"LINEAR TO POS\((.*?), '(.*?)'\)")


def with_names(texts: Mapping[str, Mapping[str, bytes]]) -> dict[str, dict[str, bytes]]:
    """Give every target of lines a name of its own, in every language."""
    own = {name: files[name].decode() for name, files in texts.items()}
    points = RAPID_TARGET.findall(own["job.mod"])
    declared = [f"  CONST robtarget p{k}:={p};" for k, p in enumerate(points)]
    rapid = _numbered(RAPID_TARGET, "MoveL p{},", own["job.mod"])
    main = "\n".join([*declared, "  PROC main()"])
    points = KRL_TARGET.findall(own["job.src"])
    listed = [f"DECL E6POS XP{k}={p}" for k, p in enumerate(points)]
    listed = ["&ACCESS RVP", "DEFDAT job", *listed, "ENDDAT", ""]
    entries = [_entry(k, *p) for k, p in enumerate(PDL2_TARGET.findall(own["job.pdl"]))]
    names = [f"  p{k} : POSITION" for k in range(len(entries))]
    pdl2 = _numbered(PDL2_TARGET, "LINEAR TO p{}", own["job.pdl"])
    begin = "\n".join(["VAR", *names, "BEGIN"])
    made = {
        "job.pdl": {"job.pdl": pdl2.replace("BEGIN", begin, 1),
                    "job.lsv": "".join(entries)},
        "job.mod": {"job.mod": rapid.replace("  PROC main()", main, 1)},
        "job.src": {"job.src": _numbered(KRL_TARGET, "SLIN XP{} C_SPL", own["job.src"]),
                    "job.dat": "\r\n".join(listed)},
    }  # fmt: skip
    return {
        name: {page: text.encode() for page, text in files.items()}
        for name, files in made.items()
    }


def _numbered(target: re.Pattern[str], named: str, text: str) -> str:
    """Replace targets by names with numbers."""
    count = itertools.count()
    return target.sub(lambda _: named.format(next(count)), text)


def _entry(k: int, numbers: str, flags: str) -> str:
    """Write a point as an entry of a variable file."""
    x, y, z, a, e, r = numbers.split(", ")
    return (f"p{k} POS Priv\n X: {x}  Y: {y}  Z: {z}  A: {a}  E: {e}  R: {r}\n"
            f" CNFG: '{flags}'\n")  # fmt: skip


def read_named(targets: int = 20_000, rounds: int = 3) -> list[str]:
    """Read one job of named points in every language in turn, and write the table."""
    with TemporaryDirectory() as folder:
        cell, _ = fitted(ARM, Path(folder))
    inline = written(milled(cell, targets))
    rows = [
        "| language | in the moves, us a target | named | of PDL2's |",
        "|---|---|---|---|",
    ]
    base = 0.0
    for name, files in with_names(inline).items():
        one, two = (_seconds_to_read(f, cell, rounds) for f in (inline[name], files))
        base = base or two
        cells = [f"{1e6 * own / targets:.1f}" for own in (one, two)]
        rows.append(f"| {NAMES[name]} | {' | '.join(cells)} | {two / base:.1f} |")
    return rows


def _seconds_to_read(files: Mapping[str, bytes], cell: Cell, rounds: int) -> float:
    """Return the processor time of the fastest round [s]."""
    best = np.inf
    for _ in range(rounds):
        begin = time.process_time()
        read_program(files, cell)
        best = min(best, time.process_time() - begin)
    return float(best)


# The same job as a KRL pendant writes it.

OLD_FORM = r"""$BWDSTART=FALSE
LDAT_ACT=LCPDAT\1
FDAT_ACT=FP\1
BAS(#CP_PARAMS,0.2)
SET_CD_PARAMS (0)
LIN XP\1 C_DIS C_DIS"""
NEW_FORM = (
    r"SLIN XP\1 WITH $VEL=SVEL_CP(0.2, , LCPDAT\1), $TOOL=STOOL2(FP\1), "
    r"$BASE=SBASE(FP\1.BASE_NO), $IPO_MODE=SIPO_MODE(FP\1.IPO_FRAME), "
    r"$LOAD=SLOAD(FP\1.TOOL_NO), $ACC=SACC_CP(LCPDAT\1), "
    r"$ORI_TYPE=SORI_TYP(LCPDAT\1), $APO=SAPO(LCPDAT\1), $JERK=SJERK(LCPDAT\1) C_SPL"
)
BEGIN = """GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )
INTERRUPT ON 3
$TOOL="""
FORMS = {"KSS 5 to 7": OLD_FORM, "KSS 8": NEW_FORM}
FORM_DATA = """DECL FDAT FP{0}={{TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " "}}
DECL LDAT LCPDAT{0}={{VEL 2.0,ACC 100.0,APO_DIST 1.0,ORI_TYP #VAR,CIRC_TYP #BASE}}
"""


def with_forms(named: Mapping[str, bytes], form: str) -> dict[str, bytes]:
    """Write the named lines of a KRL job as inline forms."""
    source, data = (named[name].decode() for name in ("job.src", "job.dat"))
    said = [re.search(rf"\${word}=(.*?)\r?\n", source) for word in ("TOOL", "BASE")]
    tool, base = (one[1] for one in said if one)
    fold = rf";FOLD LIN P\1 CONT Vel=0.2 m/s CPDAT\1 Tool[1] Base[1]\n{form}\n;ENDFOLD"
    source, count = re.subn(r"SLIN XP(\d+) C_SPL", fold.replace("\n", "\r\n"), source)
    own = "".join(FORM_DATA.format(k) for k in range(count)).replace("\n", "\r\n")
    frames = {"TOOL_DATA": tool, "BASE_DATA": base}
    entries = (f"DECL FRAME {k}[2]\r\n{k}[1]={at}" for k, at in frames.items())
    config = ["DEFDAT  $CONFIG", *entries, "ENDDAT", ""]
    source = source.replace("$TOOL=", BEGIN.replace("\n", "\r\n"), 1)
    files = {"job.src": source.replace("SPTP", "PTP" if "LIN X" in form else "SPTP"),
             "job.dat": data.replace("ENDDAT", f"{own}ENDDAT"),
             "$config.dat": "\r\n".join(config)}  # fmt: skip
    return {name: text.encode() for name, text in files.items()}


def read_forms(targets: int = 20_000, rounds: int = 3) -> list[str]:
    """Read one job of KRL as named points and as inline forms; write the table."""
    with TemporaryDirectory() as folder:
        cell, _ = fitted(ARM, Path(folder))
    named = with_names(written(milled(cell, targets)))["job.src"]
    jobs = {"named": named} | {k: with_forms(named, form) for k, form in FORMS.items()}
    rows = ["| KRL | us a target |", "|---|---|"]
    for name, files in jobs.items():
        seconds = _seconds_to_read(files, cell, rounds)
        rows.append(f"| {name} | {1e6 * seconds / targets:.1f} |")
    return rows


FLY = re.compile(rb"^ *(MOVEFLY LINEAR TO POS|MoveL|SLIN) ?[({\[].*$", re.M)


def lengthened(text: bytes, times: int) -> bytes:
    """Go through the fly points of a program so many times."""
    moves = list(FLY.finditer(text))
    begin, end = moves[0].start(), text.index(b"\n", moves[-1].end()) + 1
    return text[:begin] + times * text[begin:end] + text[end:]


def measure_files(targets: int) -> dict[str, dict[str, float]]:
    """Compensate long programs in every language, each in a process of its own.

    Returns:
        By the name of the file: seconds of every stage, and memory [MiB].
    """
    found = {}
    with TemporaryDirectory() as folder:
        place = Path(folder)
        cell, _ = fitted(ARM, place)
        texts = written(milled(cell, min(targets, ONCE)))
        given = place / "cell.toml", place / "model.json"
        for name, own in texts.items():
            own_folder = place / NAMES[name]
            own_folder.mkdir()
            for page, data in own.items():
                long = lengthened(data, targets // ONCE) if page == name else data
                (own_folder / page).write_bytes(long)
            command = [sys.executable, "-m", "tests.bench.stages", "--program"]
            command += map(str, (own_folder / name, *given))
            out, errors, code, most = watched(command, ROOT)
            if code:
                raise SystemExit(errors)
            found[name] = json.loads(out)
            found[name]["peak_mib"] = max(found[name]["peak_mib"], most)
            shutil.rmtree(own_folder)
    return found


def files_table(found: Mapping[str, dict[str, float]]) -> list[str]:
    """Write the table of long programs."""
    head = ["language", "targets", *STAGES, "all", "of PDL2's", "processor", "MiB"]
    rows = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    base = found["job.pdl"]
    for name, f in found.items():
        cells = [f"{f.get(stage, 0.0):.2f}" for stage in (*STAGES, "all")]
        share = f["all"] / f["targets"] * base["targets"] / base["all"]
        cells += [f"{share:.2f}", f"{f['processor']:.1f}", f"{f['peak_mib']:,.0f}"]
        told = [NAMES[name], f"{f['targets']:,.0f}", *cells]
        rows.append("| " + " | ".join(told) + " |")
    return rows


def compared(targets: int = 20_000, rounds: int = 3) -> list[str]:
    """Compensate one job in every language in turn, and write the table."""
    with TemporaryDirectory() as folder:
        cell, model = fitted(ARM, Path(folder))
    texts = written(milled(cell, targets))
    best: dict[str, dict[str, float]] = {}
    for _ in range(rounds):
        for name in texts:
            one = measure(name, texts[name], cell, model)
            old = best.setdefault(name, one)
            best[name] = {key: min(old[key], one[key]) for key in one}
    return table(best)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--files", action="store_true")
    parser.add_argument("--named", action="store_true")
    parser.add_argument("--inline-forms", action="store_true")
    asked = parser.parse_args()
    if asked.inline_forms:
        print("\n".join(read_forms(asked.targets, asked.rounds)))
        return
    if asked.named:
        print("\n".join(read_named(asked.targets, asked.rounds)))
        return
    if asked.files:
        print("\n".join(files_table(measure_files(asked.targets))))
        return
    print("\n".join(compared(asked.targets, asked.rounds)))


if __name__ == "__main__":
    main()
