"""What the header of a column means, in the words of many tools and three languages."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

# Units, as headers, comments and units of a sheet write them.

LENGTHS = {
    "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "inch": ("in", "inch", "inches", "zoll", "pouce", "pouces", '"'),
    "ft": ("ft", "foot", "feet", "fuss", "pied", "pieds"),
    "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    "um": ("um", "µm", "μm", "micron", "microns", "mikrometer"),
}
ANGLES = {
    "deg": ("deg", "degs", "degree", "degrees", "°", "grad", "degre", "degres"),
    "rad": ("rad", "rads", "radian", "radians", "radiant", "bogenmass"),
}
OTHERS = {
    "s": ("s", "sec", "secs", "second", "seconds", "sekunde", "sekunden", "seconde"),
    "ms": ("ms", "msec", "millisecond", "milliseconds", "millisekunden"),
    "min": ("min", "minute", "minutes", "minuten"),
    "c": ("c", "°c", "degc", "celsius", "deg c"),
    "kg": ("kg", "kilogram", "kilograms", "kilogramm"),
    "mm/s": ("mm/s", "mm s"),
}
UNIT_WORDS = {
    word: unit
    for table in (LENGTHS, ANGLES, OTHERS)
    for unit, words in table.items()
    for word in words
}


def is_unit(text: str) -> bool:
    """Return True if a cell holds a unit, in brackets or not.

    >>> is_unit("[mm]"), is_unit("Grad"), is_unit("P1")
    (True, True, False)
    """
    return _plain(text).strip("[]() ") in UNIT_WORDS


# Words beside the name of a quantity.

Kind = Literal["plain", "measured", "nominal"]
MEASURED = frozenset(
    "actual act ist istwert meas measured measurement gemessen messwert mess mesure "
    "mesuree mesures reel reelle readback read".split()
)
NOMINAL = frozenset(
    "nominal nom soll sollwert ref reference theo theoretical theorique cad target "
    "cmd command commanded commande consigne programmed programmiert tcp".split()
)
DEVIATION = frozenset(
    "dev deviation abw abweichung diff difference differenz delta ecart error err "
    "fehler erreur residual std sigma stdev tol tolerance toleranz rms min max upper "
    "lower unc uncertainty unsicherheit".split()
)
FILLING = frozenset(  # they say nothing more
    "coordinate coord koordinate koord coordonnee pos position point punkt value wert "
    "valeur tracker laser smr angle winkel robot roboter".split()
)

AXIS_WORDS = (
    "a j q theta θ axis axe achse joint jnt gelenk gelenkwinkel achswinkel rax robax "
    "ax articulation"
)
JOINT = re.compile(rf"^(?:{'|'.join(AXIS_WORDS.split())}) ?(\d)$")
LAMBDA = re.compile(r"^(?:lambda|λ|direction|richtung|sens) ?([1-6])$")
PLACE = re.compile(r"^[xyz]$")
NAMES = (  # of points, the best first: those of one line say the same
    ("id", "point id", "measure id", "pose id"),
    ("target", "target name", "zielpunkt", "cible"),
    ("point name", "punktname", "nom du point", "point", "punkt", "messpunkt"),
    ("name", "nom", "label", "object name", "object", "feature", "bezeichnung"),
    ("pose", "no", "nr", "index", "row", "number", "nummer", "numero", "n°", "#"),
)
COVARIATES = {
    "time_s": (("time", "zeit", "temps", "t"), {"s": 1.0, "ms": 1e-3, "min": 60.0}),
    "temperature_c": (("temperature", "temperatur", "temp"), {"c": 1.0}),
    "payload_kg": (("payload", "load", "last", "nutzlast", "charge"), {"kg": 1.0}),
    "speed_mm_s": (("speed", "geschwindigkeit", "vitesse"), {"mm/s": 1.0}),
}
OWN = re.compile(  # columns of ours that other spellings of case may name
    r"^(q\d_deg|lambda[1-6]|travel[1-6]_deg|[xyz]_mm|r[xyz]_deg|tool_[xyz]_mm|tool_id|"
    r"nest|order|visit|station|reference|time_s|temperature_c|payload_kg|speed_mm_s)$"
)


@dataclass(frozen=True)
class HeaderMeaning:
    """What a header says.

    Attributes:
        ours: The column of ours.
        unit: The unit it states, "" for none.
        kind: Whether it says that the value was measured, or that it is nominal.
        rank: Of names of points: lower ones name the point better.
    """

    ours: str
    unit: str = ""
    kind: Kind = "plain"
    rank: int = 0


def meaning_of(header: str) -> HeaderMeaning | None:
    """Return what a header says, None where it is none of our columns.

    >>> meaning_of("Achse 1 [°]")
    HeaderMeaning(ours='q1_deg', unit='deg', kind='plain', rank=0)
    >>> meaning_of("X measured (inch)")
    HeaderMeaning(ours='x_mm', unit='inch', kind='measured', rank=0)
    >>> meaning_of("dX [mm]") is None
    True
    """
    if OWN.match(header.lower()):
        return HeaderMeaning(header.lower(), unit=_own_unit(header.lower()))
    text, unit = _cut_unit(_plain(header))
    words = text.split()
    if not words or DEVIATION.intersection(words):
        return None
    if (rank := _rank(text)) is not None:
        return HeaderMeaning("id", rank=rank)
    kind = _kind(words)
    text = " ".join(w for w in words if w not in MEASURED | NOMINAL | FILLING)
    if match := JOINT.match(text):
        return HeaderMeaning(f"q{match.group(1)}_deg", unit, kind)
    if match := LAMBDA.match(text):
        return HeaderMeaning(f"lambda{match.group(1)}")
    if PLACE.match(text):
        return HeaderMeaning(f"{text}_mm", unit, kind)
    for ours, (known, units) in COVARIATES.items():
        if text in known and unit in units:
            return HeaderMeaning(ours, unit)
    return None


def _own_unit(name: str) -> str:
    """Return the unit that a name of ours ends with."""
    return "deg" if name.endswith("_deg") else "mm" if name.endswith("_mm") else ""


def _plain(header: str) -> str:
    """Return a header in lower case without accents, its words parted by blanks."""
    text = unicodedata.normalize("NFKD", header.lower().replace("ß", "ss"))
    text = "".join(c for c in text if not unicodedata.combining(c))
    return " ".join(re.sub(r"[_:;\s]+", " ", text).split())


def _cut_unit(text: str) -> tuple[str, str]:
    """Part a unit from a header: in brackets, after a stroke, or as the last word."""
    unit = ""
    for inside in re.findall(r"[\[(<{]([^\])>}]*)[\])>}]", text):
        word = inside.strip().rstrip(".")
        unit = unit or UNIT_WORDS.get(word, "")
        known = word in UNIT_WORDS
        text = re.sub(
            rf"[\[(<{{]{re.escape(inside)}[\])>}}]", " " if known else f" {word} ", text
        )
    text = " ".join(re.sub(r"[.\-]", " ", text).split())
    for pattern in (r"^(.+?) ?/ ?(\S+)$", r"^(.+) in (\S+)$", r"^(.+) (\S+)$"):
        match = re.match(pattern, text)
        if not unit and match and match.group(2) in UNIT_WORDS:
            text, unit = match.group(1), UNIT_WORDS[match.group(2)]
    return text.strip(), unit


def _rank(text: str) -> int | None:
    """Return how well a header names points, None where it does not."""
    found = (rank for rank, words in enumerate(NAMES) if text in words)
    return next(found, None)


def _kind(words: Sequence[str]) -> Kind:
    """Return whether words say that a value was measured, or is nominal."""
    if MEASURED.intersection(words):
        return "measured"
    return "nominal" if NOMINAL.intersection(words) else "plain"


@dataclass(frozen=True)
class HeaderColumns:
    """The columns of a table that headers name.

    Attributes:
        sources: By column of ours: the file's column and the unit it states.
        rivals: By column of ours: columns of the file of which each may be meant.
        unused: Columns of the file that are none of ours, or nominal values.
    """

    sources: dict[str, tuple[str, str]]
    rivals: dict[str, tuple[str, ...]]
    unused: tuple[str, ...]


def find_columns(headers: Iterable[str]) -> HeaderColumns:
    """Find our columns by the headers of a table.

    A position that is said to be measured counts where others are said to be nominal,
    and a nominal one never does. Two columns for one of ours are rivals.
    """
    headers = tuple(headers)
    found = {header: meaning_of(header) for header in headers}
    found = _count_from_one(found)
    sources, rivals = {}, {}
    for ours in dict.fromkeys(m.ours for m in found.values() if m is not None):
        claims = {h: m for h, m in found.items() if m is not None and m.ours == ours}
        best = _best(ours, claims)
        if len(best) == 1:
            sources[ours] = (best[0], claims[best[0]].unit)
        elif best and ours not in COVARIATES:
            rivals[ours] = tuple(best)
    taken = {source for source, _ in sources.values()}
    asked = {name for names in rivals.values() for name in names}
    unused = tuple(h for h in headers if h not in taken | asked)
    return HeaderColumns(_one_unit(sources), rivals, unused)


def _best(ours: str, claims: dict[str, HeaderMeaning]) -> list[str]:
    """Return the headers that claim one of our columns with the same right."""
    if ours in claims:
        return [ours]
    if ours == "id":
        first = min(m.rank for m in claims.values())
        return [h for h, m in claims.items() if m.rank == first]
    if ours[0] in "xyz":
        kinds = {h: m.kind for h, m in claims.items() if m.kind != "nominal"}
        measured = [h for h, kind in kinds.items() if kind == "measured"]
        plain = [h for h, kind in kinds.items() if kind == "plain"]
        nominal = len(kinds) < len(claims)
        return measured if measured and (nominal or not plain) else [*measured, *plain]
    return list(claims)


def _count_from_one(
    found: dict[str, HeaderMeaning | None],
) -> dict[str, HeaderMeaning | None]:
    """Count joints from 1 where the file counts six of them from 0."""
    joints = {m.ours for m in found.values() if m is not None and m.ours[0] == "q"}
    if joints != {f"q{k}_deg" for k in range(6)}:
        return found
    return {
        h: m
        if m is None or m.ours not in joints
        else HeaderMeaning(f"q{int(m.ours[1]) + 1}_deg", m.unit, m.kind)
        for h, m in found.items()
    }


def _one_unit(sources: dict[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
    """Let the one unit that some of a group state hold for all of the group."""
    out = dict(sources)
    for group in (re.compile(r"^q\d_deg$"), re.compile(r"^[xyz]_mm$")):
        own = [ours for ours in sources if group.match(ours)]
        units = {sources[ours][1] for ours in own} - {""}
        if len(units) == 1:
            out |= {ours: (sources[ours][0], next(iter(units))) for ours in own}
    return out


# Units that lines above a table state for all of it.

UNITS_LINE = re.compile(
    r"\b(?:units?|einheit(?:en)?|unites?|lengths?|laengen?|langen?|longueurs?|angles?|"
    r"winkel|in|en)\b\W*(?:length|linear|angular|lange|angle|winkel)?\W*([a-z°µ]+)"
)


def units_in(lines: Iterable[str]) -> set[str]:
    """Return the units of lengths and angles that lines state.

    >>> sorted(units_in(["// Units: Inches", "// Angles: Degrees"]))
    ['deg', 'inch']
    """
    found = set()
    for line in lines:
        text = _plain(line).strip("/#%!; ,")
        words = [text, *UNITS_LINE.findall(text)]
        found |= {UNIT_WORDS[word] for word in words if word in UNIT_WORDS}
    return found & {*LENGTHS, *ANGLES}
