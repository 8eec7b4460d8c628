"""Rows and columns of CSV files of any origin: separators, names and units in use, and number formats."""

import csv
import math
import re
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import product
from typing import NamedTuple

from hindrax_core.errors import UsageError

COLUMNS: dict[str, str] = {
    "t": "time [s], from any origin",
    "u": "surge, forward [m/s]",
    "v": "sway, to starboard [m/s]",
    "w": "heave, down [m/s]",
    "p": "roll rate [rad/s]",
    "q": "pitch rate [rad/s]",
    "r": "yaw rate, clockwise from above [rad/s]",
    "X": "force forward [N]",
    "Y": "force to starboard [N]",
    "Z": "force down [N]",
    "K": "moment about x [N m]",
    "M": "moment about y [N m]",
    "N": "moment about z [N m]",
    "roll": "angle [rad]; with K: the motion in roll without p",
    "pitch": "angle [rad]; with M: the motion in pitch without q",
    "depth": "below the surface [m]; used for heave without w",
    "px": "position along a level axis, such as north [m]; with py and yaw: surge without u, sway without v",
    "py": "position to the right of px, seen from above [m]",
    "yaw": "heading from px, clockwise from above [rad]; with N: the motion in yaw without r",
    "vn": "velocity north, or along px [m/s]; with ve and yaw: surge without u, sway without v",
    "ve": "velocity east, to the right of vn, seen from above [m/s]",
    "vd": "velocity down, of a level world [m/s]; with vn, ve, yaw, roll and pitch: heave without w",
    **{f"q{part}": "quaternion of the body in the world: roll, pitch, and yaw for px and py" for part in "wxyz"},
}
"""Columns of a CSV record, in SNAME axes. Time, one velocity and the force on the same axis are needed."""

QUATERNION = ("qx", "qy", "qz", "qw")
"""Columns of a quaternion, in the order of ROS and scipy."""

DEGREE = math.pi / 180.0
KGF, LBF, INCH = 9.80665, 4.4482216152605, 0.0254
_TIME = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "usec": 1e-6, "ns": 1e-9, "nsec": 1e-9, "min": 60.0}
_TIME |= {"h": 3600.0, "d": 86400.0, "days": 86400.0}
_SPEED = {"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "ft/s": 12.0 * INCH}
_SPEED |= {
    "mps": 1.0,
    "cmps": 0.01,
    "mmps": 1e-3,
    "ms": 1.0,
    "cms": 0.01,
    "mms": 1e-3,
    **dict.fromkeys(("kt", "kts", "knots"), _SPEED["kn"]),
}
_RATE = {
    "rad/s": 1.0,
    "radps": 1.0,
    "rads": 1.0,
    "degs": DEGREE,
    "deg/s": DEGREE,
    "degps": DEGREE,
    "dps": DEGREE,
    "rpm": math.tau / 60.0,
}
_FORCE = {"n": 1.0, "kn": 1e3, "mn": 1e-3, "kgf": KGF, "gf": 1e-3 * KGF, "lbf": LBF}
_MOMENT = {"nm": 1.0, "knm": 1e3, "mnm": 1e-3, "kgfm": KGF, "lbfft": LBF * 12.0 * INCH, "lbfin": LBF * INCH}
_ANGLE = {"rad": 1.0, "deg": DEGREE}
_LENGTH = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "ft": 12.0 * INCH}
UNITS: dict[str, dict[str, float]] = {
    "t": _TIME,
    **dict.fromkeys("uvw", _SPEED),
    **dict.fromkeys("pqr", _RATE),
    **dict.fromkeys("XYZ", _FORCE),
    **dict.fromkeys("KMN", _MOMENT),
    "roll": _ANGLE,
    "pitch": _ANGLE,
    **dict.fromkeys(("depth", "px", "py"), _LENGTH),
    "yaw": _ANGLE,
    **dict.fromkeys(("vn", "ve", "vd"), _SPEED),
    **{part: {"1": 1.0} for part in QUATERNION},
    "t_ns": {},
}
"""SI factor of each unit that a column may have."""

_ALONG = (
    ("speed velocity vel sog ground_speed groundspeed", {"u": "surge", "v": "sway", "w": "heave"}),
    ("force thrust", {"X": "surge", "Y": "sway", "Z": "heave"}),
    ("rate angular_velocity", {"p": "roll", "q": "pitch", "r": "yaw"}),
    ("torque moment", {"K": "roll", "M": "pitch", "N": "yaw"}),
)
AXES_OF = {name: columns for names, columns in _ALONG for name in names.split()}
"""Names of a quantity without an axis, and the columns they may be, by motion."""

VECTORS = {"nu": "uvwpqr", "tau": "XYZKMN"}
"""Velocities and forces as the vectors of Fossen 2011 (eq. 2.4, 2.5), in columns with numbers from 0 or from 1."""
ORIGINS = frozenset({
    "dvl", "imu", "odom", "odometry", "ekf", "nav", "navigation", "est", "estimate", "estimated", "meas", "measured",
    "attitude", "body", "rov", "auv", "vehicle", "robot", "state",
})  # fmt: skip
"""Words that say where a number is from, not what it is."""
_AXES_OF_WORLD = "(north|east|down|enu|ned|world|map)"
OTHERWISE = {
    re.compile(
        rf"(.*_)?(v|vel|velocity|speed)(_?[xyz])?_{_AXES_OF_WORLD}"
    ): "along axes of the world: name them vn, ve "
    "and vd (north, east, down), with roll, pitch and yaw, or turn them into u, v, w of the body",
    re.compile(r"(q|quat|quaternion|orientation)_?[0-3]"): "a quaternion without names of its parts: call them qw, qx, "
    "qy and qz",
    re.compile(
        r"(?!ang)(.*_)?(vel|velocity)_?[0-2]"
    ): "velocities without a frame: call them u, v and w along the body's axes "
    "(PX4: velocity_frame 3), or vn, ve and vd along north, east and down (1)",
}
"""Names of what is recorded in other axes, or in another way, than it is read, and what to do."""
UNKNOWN = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"}
"""Cells without a value."""
PREAMBLE = 40
"""Lines searched for the header line."""
Row = tuple[int, list[str]]
"""Line number, and its cells without spaces around them."""
_IN_BRACKETS = re.compile(r"^(?P<name>.*?)[\s/,;]*[\[(](?P<unit>[^\])]*)[\])]\s*$")
_BEHIND_MARK = re.compile(r"(?P<name>[^/,;]+?)\s*[/,;]\s*(?P<unit>\S.*)")
"""`X/N`, as ISO 80000 writes a unit, and `u, m/s`; a path of a message is none, as its last word is no unit."""
_SPELLED = re.compile(
    r"\b(nano|micro|milli|centi|kilo)?(seconds?|secs?|met(?:er|re)s?|newtons?|radians?|degrees?|minutes?|hours?)\b"
)
_SYMBOLS = {"nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k"}
_SYMBOLS |= {"sec": "s", "met": "m", "new": "n", "rad": "rad", "deg": "deg", "min": "min", "hou": "h"}
"""Symbols of spelled units and their prefixes, by the first letters of the unit."""


class Meaning(NamedTuple):
    """A column of `COLUMNS`, the SI factor of its numbers, and whether the header line names the unit.

    `gives_way`: a looser name, which is not used where another column of the same meaning has a usual one.
    """

    name: str
    factor: float
    has_unit: bool
    gives_way: bool = False


def _names() -> Iterator[tuple[str, str]]:
    """Names in use, in lower case, and the column of each."""
    times = ("time", "times", "timestamp", "timestamps", "time_stamp", "stamp", "header_stamp", "elapsed")
    yield from ((name, "t") for name in times)
    yield from (("phi", "roll"), ("theta", "pitch"), ("roll", "roll"), ("pitch", "pitch"), ("depth", "depth"))
    yield from (("psi", "yaw"), ("heading", "yaw"), ("north", "px"), ("east", "py"))
    for axis, word, column in zip("xyz", ("north", "east", "down"), ("vn", "ve", "vd"), strict=True):
        along = ("v", "vel", "velocity")
        yield from ((name, column) for name in (column, *_pairs(word, (*along, "speed")), *_pairs(word[0], along)))
        yield from ((f"{name}_ned", column) for name in (f"v{axis}", f"vel_{axis}", f"velocity_{axis}"))
    words = ("q", "quat", "quaternion", "orientation", "orient")
    yield from ((f"{name}{gap}{part}", f"q{part}") for name in words for gap in ("", "_") for part in "wxyz")
    yield from ((name, f"p{axis}") for axis in "xy" for name in _pairs(axis, ("pos", "position")))
    for axis, word, speed, force in zip("xyz", ("surge", "sway", "heave"), "uvw", "XYZ", strict=True):
        speeds = [word, *_pairs(word, ("velocity", "vel", "speed")), f"v{axis}", f"linear_{axis}"]
        yield from ((name, speed) for name in (*speeds, *_pairs(axis, ("v", "vel", "velocity"))))
        forces = [f"f{axis}", f"tau_{speed}", *_pairs(word, ("force", "thrust", "tau"))]
        yield from ((name, force) for name in (*forces, *_pairs(axis, ("f", "force", "thrust", "tau"))))
    for axis, word, rate, moment in zip("xyz", ("roll", "pitch", "yaw"), "pqr", "KMN", strict=True):
        rates = [*_pairs(word, ("rate", "velocity", "speed")), f"w{axis}", f"omega_{axis}", f"gyro_{axis}"]
        yield from ((name, rate) for name in (*rates, f"angular_{axis}", f"angular_velocity_{axis}"))
        moments = [f"torque_{axis}", f"moment_{axis}", f"tau_{rate}", f"tau_{moment.lower()}"]
        yield from ((name, moment) for name in (*moments, *_pairs(word, ("moment", "torque", "tau"))))


def _more_names() -> Iterator[tuple[str, str]]:
    """Names in use that give way to those of `_names`, and the column of each."""
    times = ("elapsed_time", "time_boot", "seconds", "sec", "secs", "date_time", "datetime", "utc")
    since_1970 = ("utc_timestamp", "timestamp_utc", "unix_time", "epoch", "epoch_time", "ros_time")
    yield from ((name, "t") for name in (*times, *since_1970))
    yield from ((axis, f"p{axis}") for axis in "xy")
    yield from ((name, NANOSECONDS) for name in ("nanosec", "nanosecs", "nanoseconds", "nsec", "nsecs"))
    yield from (("forward_velocity", "u"), ("forward_speed", "u"))
    for axis, word, speed, rate in zip("xyz", ("roll", "pitch", "yaw"), "uvw", "pqr", strict=True):
        yield from ((f"{name}_{axis}", speed) for name in ("linear_velocity", "linear_vel", "lin_vel"))
        yield from ((f"{name}_{axis}", rate) for name in ("gyr", "ang_vel", "angular_vel", "angular_rate"))
        yield from ((name, rate) for name in (f"{word}rate", f"{word}speed", *_pairs(word, ("vel",))))
    for words, letter, columns in ((("surge", "sway", "heave"), "f", "XYZ"), (("roll", "pitch", "yaw"), "m", "KMN")):
        yield from ((f"{letter}_{word}", column) for word, column in zip(words, columns, strict=True))
    for vector, columns in VECTORS.items():
        yield from ((f"{vector}_{number}", column) for number, column in enumerate(columns, start=1))


def _pairs(word: str, others: Sequence[str]) -> list[str]:
    return [f"{a}_{b}" for other in others for a, b in ((word, other), (other, word))]


NANOSECONDS = "t_ns"
"""The nanoseconds of a stamp in two columns."""
PLACES = {"X": "px", "Y": "py", "Z": None}
"""Names of forces that are positions where their unit is a length; which way a Z points, nobody says."""
MOMENTS = {"mx": "K", "my": "M", "mz": "N"}
"""Names of moments with their unit, without it of magnetic fields."""
NAMES: dict[str, str] = dict(_names())
MORE_NAMES: dict[str, str] = {**dict(_more_names()), **NAMES}
_ENDINGS = {
    **{f"_position_{axis}": f"p{axis}" for axis in "xy"},
    **{f"_{word}_{part}": f"q{part}" for word in ("orientation", "rotation", "quaternion") for part in "wxyz"},
    **{f"_{field}": NAMES[field] for field in map("_".join, product(("linear", "angular", "force", "torque"), "xyz"))},
    **{f"stamp_{seconds}": "t" for seconds in ("sec", "secs")},
    **{f"stamp_{rest}": NANOSECONDS for rest in ("nanosec", "nsecs")},
}
"""Last parts of the fields of Twist, Wrench and Header, with any prefix of a tool."""


def meaning_of(header: str) -> Meaning | None:
    """Meaning of a column by its header; None for an unused one. UsageError for an unknown unit of a usual name."""
    found = _meaning(header.strip(), _name, unit_words=1)
    if found:
        return found
    try:
        looser = _meaning(_apart(header.strip()), _looser_name, unit_words=2)
    except UsageError:
        return None
    return looser and looser._replace(gives_way=True)


def _meaning(header: str, name_of: Callable[[str], str | None], unit_words: int) -> Meaning | None:
    """Meaning by one table of names; the unit is in brackets or, where there are none, up to so many last words."""
    brackets = _IN_BRACKETS.match(header)
    if brackets:
        name = name_of(brackets["name"]) or MOMENTS.get(_words(brackets["name"]))
        unit = plain_unit(brackets["unit"])
        if name in MOMENTS.values() and unit not in _MOMENT:
            return None
        if name in PLACES and unit in _LENGTH:
            name = PLACES[name]
        return (name and Meaning(name, factor_of(name, brackets["unit"], header), has_unit=True)) or None
    name = name_of(header)
    if name:
        return Meaning(name, 1e-9 if name == NANOSECONDS else 1.0, has_unit=name == NANOSECONDS)
    words = header.split("_")
    apart = [("_".join(words[:-last]), "_".join(words[-last:])) for last in range(1, unit_words + 1)]
    for before, unit in (*apart, *_BEHIND_MARK.findall(header)):
        name = name_of(before)
        factor = UNITS[name].get(plain_unit(unit)) if name else None
        if name and factor:
            return Meaning(name, factor, has_unit=True)
    return None


def is_of_message(header: str) -> bool:
    """Whether a column is a field of a Twist or Wrench by its path, which says no axes that point down."""
    words = _words(header).split("_")
    field = bool({"twist", "wrench"} & set(words)) and bool({"linear", "angular", "force", "torque"} & set(words))
    return field and not {"ned", "frd", "fsd", "sname"} & set(words)


def near_miss(header: str) -> str:
    """Remedy for an ambiguous column header; empty for an unused column."""
    if any(pattern.fullmatch(_words(header)) for pattern in OTHERWISE):
        return ""
    before, _, unit = header.strip().rpartition("_")
    for text, suffix in ((header, ""), (before, f"_{unit}")):
        columns = AXES_OF.get(_words(text), {})
        if columns:
            names = " or ".join(f"{column}{suffix} for {moved}" for column, moved in columns.items())
            signed = ", if it has the sign of the motion" if set(columns) <= set("uvw") else ""
            return f"{header} names no axis: call it {names}{signed}"
    name = _name(before) if before else None
    return f"{header}: the unit {unit!r} is none of {', '.join(UNITS[name])}" if name and not _name(header) else ""


def otherwise_recorded(header: Sequence[str]) -> list[str]:
    """Remedies for columns (`OTHERWISE`) that hold what is wanted in another way, one for each kind of them."""
    found = {
        remedy: [cell for cell in header if pattern.fullmatch(_words(cell)) and not meaning_of(cell)]
        for pattern, remedy in OTHERWISE.items()
    }
    return [f"{', '.join(cells)} are {remedy}" for remedy, cells in found.items() if cells]


def factor_of(name: str, unit: str, where: str) -> float:
    """SI factor of a column.

    Parameters
    ----------
    name, unit
        Of the column.
    where
        File and line, for the error.

    Returns
    -------
    float
        Times a cell it is SI.

    Raises
    ------
    UsageError
        For a unit that the column cannot have.
    """
    factor = UNITS[name].get(plain_unit(unit))
    if factor is None:
        known = ", ".join(UNITS[name])
        raise UsageError(f"column {where}: found the unit {unit!r}, wanted one of {known}; change the header line")
    return factor


def plain_unit(unit: str) -> str:
    """A unit in normalized spelling: by its symbols, with a slash."""
    # Raised digits and signs become plain ones, and the micro sign the Greek letter.
    text = unicodedata.normalize("NFKC", unit.strip().lower()).replace("\N{GREEK SMALL LETTER MU}", "u")
    text = text.replace("\N{DEGREE SIGN}", "deg").replace("per", "/")
    text = _SPELLED.sub(lambda found: _SYMBOLS.get(found[1], "") + _SYMBOLS[found[2][:3]], text)
    return re.sub(r"[\s*.·_^\N{MINUS SIGN}-]+", "", text).replace("s1", "/s")


def _name(text: str) -> str | None:
    bare = text.strip().strip("%").strip()
    if bare in COLUMNS:
        return bare
    words = _words(bare)
    if words in NAMES:
        return NAMES[words]
    return next((name for ending, name in _ENDINGS.items() if words.endswith(ending)), None)


def _looser_name(text: str) -> str | None:
    """Column of a name in other spellings, without the words that say where a number is from."""
    if text in COLUMNS:
        return text
    words: list[str] = re.findall(r"[0-9A-Za-z]+", _apart(text))
    own = [word for word in words if word.lower() not in ORIGINS]
    if len(own) == 1 and own[0] in COLUMNS:
        return own[0]
    return MORE_NAMES.get("_".join(words).lower()) or MORE_NAMES.get("_".join(own).lower())


def _words(text: str) -> str:
    return re.sub(r"[^0-9a-z]+", "_", text.lower()).strip("_")


def _apart(text: str) -> str:
    """`GyrZ` and `TimeUS` as two words each: capitals may begin an axis or a unit."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text)


_OF_PX4 = re.compile(r"(.*[._/])?q\[[0-3]\]")


def from_one(header: Sequence[str]) -> list[str]:
    """Header line in which vectors such as nu[0] ... nu[5] are nu_1 ... nu_6, and q[0] ... q[3] of PX4 qw ... qz.

    PX4's messages have the real part first (VehicleAttitude). In any language the time is the only column with a
    unit of time.

    Parameters
    ----------
    header
        Cells of the header line.

    Returns
    -------
    list[str]
        As many names.
    """
    if len(places := [i for i, cell in enumerate(header) if _OF_PX4.fullmatch(cell.strip())]) == len(QUATERNION):
        named = {i: f"q{part}" for i, part in zip(places, "wxyz", strict=True)}
        header = [named.get(i, cell) for i, cell in enumerate(header)]
    timed = {i: found for i, cell in enumerate(header) if (found := _time_by_unit(cell))}
    if len(timed) == 1 and not any(_is_time(cell) for cell in header):
        header = [timed.get(i, cell) for i, cell in enumerate(header)]
    counted = [re.fullmatch(rf"({'|'.join(VECTORS)})_?(\d)", _words(cell)) for cell in header]
    from_zero = {found[1] for found in counted if found and found[2] == "0"}
    return [
        f"{found[1]}_{int(found[2]) + (found[1] in from_zero)}" if found else cell
        for cell, found in zip(header, counted, strict=True)
    ]


def _time_by_unit(cell: str) -> str:
    """The name `t [ms]` for a column with a unit of time in brackets; empty for others."""
    found = _IN_BRACKETS.match(cell.strip())
    return f"t [{found['unit']}]" if found and plain_unit(found["unit"]) in _TIME else ""


def _is_time(cell: str) -> bool:
    try:
        found = meaning_of(cell)
    except UsageError:
        return False
    return bool(found and found.name == "t")


def number(text: str) -> float:
    """A cell as a number; NaN for one without a value. ValueError for other text."""
    try:
        value = float(text)
    except ValueError:
        if text.lower() in UNKNOWN:
            return math.nan
        raise
    return value if math.isfinite(value) else math.nan


_CLOCK = re.compile(r"(?:(\d+):)?(\d+):(\d+(?:\.\d*)?)")
_DURATION = re.compile(r"(-?[\d.]+(?:e[+-]?\d+)?)\s*([a-z]+)", re.IGNORECASE)


def time_of(text: str) -> float:
    """A time in seconds: a number, `0.1 sec`, a clock's `1:02:03.4`, or an ISO 8601 date and time since 1970."""
    try:
        return number(text)
    except ValueError:
        if clock := _CLOCK.fullmatch(text):
            return 3600.0 * float(clock[1] or 0) + 60.0 * float(clock[2]) + float(clock[3])
        if (lasting := _DURATION.fullmatch(text)) and plain_unit(lasting[2]) in _TIME:
            return float(lasting[1]) * _TIME[plain_unit(lasting[2])]
        found = datetime.fromisoformat(text)
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


# ---- rows


def rows_of(text: str, source: str, is_header: Callable[[str], bool] = bool) -> list[Row]:
    """Row of the header line, or else of the first line, and of each line below it.

    Separators are comma, semicolon, tab or bar, or spaces where there is no other; empty lines and those that begin
    with # are skipped, but for a header line where no other line is one: numpy writes it so. Where the comma
    does not separate it is that of decimals, and becomes a point.

    Parameters
    ----------
    text, source
        Of the file, and its name for errors.
    is_header
        Whether the cells of a line are names.

    Returns
    -------
    list[Row]
        None for a file without rows.

    Raises
    ------
    UsageError
        For what is no text of lines and cells.
    """
    numbered = [(n, line.lstrip("\ufeff")) for n, line in enumerate(text.splitlines(), start=1)]
    lines = [(n, line) for n, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    begin = next((i for i, (_, line) in enumerate(lines[:PREAMBLE]) if is_header(line)), None)
    named: list[tuple[int, str]] = []
    if begin is None and is_header is not bool:
        comments = [(n, line.lstrip().lstrip("#").strip()) for n, line in numbered if line.lstrip().startswith("#")]
        named = [one for one in comments[:PREAMBLE] if is_header(one[1])]
    lines = [*named[-1:], *lines[begin or 0 :]]
    try:
        cells = cells_of([line for _, line in lines])
    except csv.Error as error:
        raise UsageError(f"{source}: is not CSV ({error})") from error
    if len(cells) != len(lines):
        raise UsageError(f"{source}: a quotation mark is not closed, wanted one row per line")
    return [(n, row) for (n, _), row in zip(lines, cells, strict=True)]


def cells_of(lines: Sequence[str]) -> list[list[str]]:
    """Cells of each line, separated as in the first one."""
    first = next(iter(lines), "")
    found = max(",;\t|", key=first.count)
    separator = found if found in first else " "
    spaced = separator == " "
    rows = csv.reader((line.strip() for line in lines) if spaced else lines, delimiter=separator, skipinitialspace=True)
    return [[(cell if separator == "," else cell.replace(",", ".")).strip() for cell in row] for row in rows]


def check_width(cells: Sequence[str], header: Sequence[str], where: str) -> None:
    """Refuse a row with more cells than the header line: its cells may be shifted.

    Parameters
    ----------
    cells, header
        Of the row and of the header line.
    where
        File and line.

    Raises
    ------
    UsageError
        With both numbers.
    """
    if any(cells[len(header) :]):
        raise UsageError(
            f"{where}: found {len(cells)} cells, wanted {len(header)} as in the header line; write decimals with a "
            "point, or separate the cells with semicolons"
        )
