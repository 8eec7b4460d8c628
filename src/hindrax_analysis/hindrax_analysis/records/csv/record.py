"""CSV records of any origin: the header line names columns and units."""

import csv
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.bag_track import (
    STEP_BACK_PERIODS,
    STEP_BACK_S,
    are_exact,
    velocities_from_poses,
    ways_from_poses,
)
from hindrax_analysis.records.csv.angles import ANGLES, in_radians
from hindrax_analysis.records.csv.axes import (
    OF_WORLD,
    PLACE,
    frame_by_depth,
    with_angles,
    with_angles_of_quaternion,
    with_axes_of_body,
    with_depths,
    with_velocities_of_world,
)
from hindrax_analysis.records.csv.columns import (
    NANOSECONDS,
    QUATERNION,
    Meaning,
    Row,
    cells_of,
    check_width,
    from_one,
    is_of_message,
    meaning_of,
    near_miss,
    number,
    otherwise_recorded,
    plain_unit,
    rows_of,
    time_of,
)
from hindrax_analysis.records.csv.thrusters import (
    MEANING,
    OUTPUTS,
    OutputColumn,
    output_columns,
    output_of,
    outputs_of,
    supply_column,
)
from hindrax_analysis.records.recording import (
    HALF_TURN,
    NO_FORCES,
    NO_TIMES,
    NO_WAYS,
    Recording,
    are_parts,
    joined,
    wrenches_of_forces,
)
from hindrax_analysis.records.thruster_values import FORCES as THRUSTER_FORCES
from hindrax_bag.read.message_columns import TIME
from hindrax_core.errors import UsageError
from hindrax_core.signals import NAN, Supply
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array

MOST_LINES = 250_000
"""More than an hour at 60 Hz; the identification of as many takes 2 GB."""
UNIX_SCALES = ((1e17, 1e-9, "ns"), (1e14, 1e-6, "us"), (1e11, 1e-3, "ms"))
"""Times above the first number are since 1970: factor and unit."""
FORCES = "XYZKMN"
THRUSTER = "thruster "
"""Before the number of a column with the force of a thruster [N]."""
AXES_OF = {"flu": "x forward, y left, z up", "fsd": "SNAME: x forward, y starboard, z down"}
COARSE_CLOCK = "several lines share each time, as by a coarse clock: they are spread evenly"
REAL_FORCES = "forces are those achieved by the thrusters, about the center of mass"

WANTED_TIME = "seconds with a decimal point, or a time as 2024-05-01T12:00:00.5"
FEWEST_ROWS, MOST_RECORDS = 20, 50
"""Shorter or more numerous than this, pieces between steps back are no records but lines out of order."""
LONGEST_SHOWN, MOST_SHOWN = 40, 24
DAY_S, MINUTE_S = 86_400.0, 60.0
ROWS_OF_TICK, MOST_TICKS, SHARE_OF_ROWS = 1.5, 1.5, 0.9
"""Rows to a tick from which a clock is coarse, ticks over which they are spread at most, and the share of rows that
hold both a velocity and a force in a table of one clock."""


def read_records(
    text: str, source: str, frame: str = "", *, part: bool = False, vehicle: Vehicle | None = None
) -> list[Recording]:
    """Read the records of a file with named columns (`COLUMNS`); cells may be empty, so rates may differ.

    A time that steps back begins another record: trials pasted below each other, a clock that began again. Pieces of
    the same time with different columns are one record.

    Parameters
    ----------
    text, source
        Of the file, and its name. UsageError names line and column, what was found and what was wanted.
    frame
        Body axes of all columns, flu or fsd; empty: fsd, or flu where depth and velocity say so.
    part
        Whether velocities or forces alone do.
    vehicle
        Makes forces of the columns of single thrusters (`thrusters`); None: not known.

    Returns
    -------
    list[Recording]
        In SNAME axes, SI.
    """
    header, rows = _rows(text, source)
    header, units = _with_units(header, rows)
    rows = [row for row in rows if row[1] != units] if units else rows
    meanings, outputs = _meanings(header, source, part=part)
    outputs = {i: one.with_unit(units[i]) if i < len(units) else one for i, one in outputs.items()}
    for line, cells in rows:
        check_width(cells, header, f"{source}, line {line}")
    columns = {
        meaning.name: meaning.factor * _values(rows, i, meaning.name, f"column {header[i]}", source)
        for i, meaning in meanings.items()
    }
    if "t_ns" in columns:
        columns["t"] = array(columns["t"] + columns.pop("t_ns"))
    _check_times(columns["t"], rows, source)
    once = _rows_once(columns["t"], rows)
    repeated = len(rows) - len(once)
    rows, columns = [rows[i] for i in once], {name: array(values[once]) for name, values in columns.items()}
    by_size = ""
    if not any(meaning.has_unit for meaning in meanings.values() if meaning.name == "t"):
        size = abs(float(np.median(columns["t"])))
        for factor, unit in [(factor, unit) for least, factor, unit in UNIX_SCALES if size > least][:1]:
            columns["t"], by_size = array(factor * columns["t"]), f"times are in {unit} since 1970, by their size"
    unnamed = {meaning.name for meaning in meanings.values() if not meaning.has_unit}
    columns["t"] = _over_midnight(columns["t"])
    forces_are, supply = REAL_FORCES, Supply.ASSUMED
    if outputs:
        made_forces, forces_are, supply = _forces_of_outputs(outputs, header, rows, source, vehicle)
        columns |= made_forces
    columns, by_angles = in_radians(columns, unnamed, vehicle.inertia if vehicle else ())
    columns, by_quaternion = with_angles_of_quaternion(columns)
    columns, by_pose = with_axes_of_body(columns)
    columns, made, by_world = with_velocities_of_world(columns)
    # Forces of outputs are in the axes of the vehicle file, whatever those of the velocities are.
    of_messages = [*(FORCES if outputs else ""), *(meanings[i].name for i in meanings if is_of_message(header[i]))]
    frame, columns, axes = _axes(columns, frame, of_messages)
    if frame == "flu":
        # The whole record is turned below, and these are in SNAME axes already.
        signs = dict(zip((*FORCES, *"uvw"), [*HALF_TURN.tolist(), *HALF_TURN[:3].tolist()], strict=True))
        columns |= {name: array(signs[name] * columns[name]) for name in (*(FORCES if outputs else ""), *made)}
    tables = [{name: values[piece] for name, values in columns.items()} for piece in _pieces(columns["t"])]
    spread = [_spread(one, source) for one in tables]
    coarse = COARSE_CLOCK if any(one is not other for one, other in zip(spread, tables, strict=True)) else ""
    parts = [_recording(source, one) for one in spread]
    recordings = _together([one for one in parts if one.measured_t or len(one.wrench_t)])
    steps = "once" if len(recordings) == 2 else f"{len(recordings) - 1} times"
    back = f"time steps back {steps}: {len(recordings)} records" if len(recordings) > 1 else ""
    twice = f"{repeated} lines that repeat others were left out" if repeated else ""
    rated = [f"{ANGLES[angle]} follows from {angle}" for angle in _rated(columns)]
    unknown = [cell for i, cell in enumerate(header) if i not in meanings and i not in outputs and cell]
    alone = _alone(columns, unknown)
    of_motion = (*by_angles, *by_quaternion, *by_pose, *by_world, *rated)
    assumptions = tuple(one for one in (by_size, *of_motion, *axes, forces_are, alone, twice, coarse, back) if one)
    turned = [one.half_turned() if frame == "flu" else one for one in recordings]
    return [replace(one, assumptions=assumptions, supply=supply) for one in turned]


def _alone(columns: Collection[str], unknown: list[str]) -> str:
    """A note on motions whose force is not there, where columns that were not understood may be it."""
    lacks = [force for speed, force in zip("uvwpqr", FORCES, strict=True) if speed in columns and force not in columns]
    return f"no column is {', '.join(lacks)}; not understood: {_listed(unknown)}" if lacks and unknown else ""


def _axes(
    columns: dict[str, Array], named: str, of_messages: Collection[str]
) -> tuple[str, dict[str, Array], tuple[str, ...]]:
    """Frame of all columns, the columns with depths and angles that count as their rates do, and what was assumed.

    Velocities and forces that all have the names of ROS messages are in its axes, as in a bag.
    """
    columns, heights = with_depths(columns)
    columns, turned = with_angles(columns)
    shown = frame_by_depth(columns)
    told = {name for name in columns if name in (*"uvwpqr", *FORCES)}
    by_names = "flu" if told and told <= set(of_messages) else ""
    frame = named or shown or by_names or "fsd"
    by_ros = ", by the names of ROS messages (REP-103)" if by_names else ""
    how = ", as named" if named else ", by depth and w" if shown else by_ros
    how += f", but depth and w say {shown}" if named and shown not in ("", named) else ""
    return frame, columns, (f"axes are {AXES_OF[frame]}{how}", *heights, *turned)


def _rows_once(t: Array, rows: list[Row]) -> list[int]:
    """Rows that repeat no other in every cell; all of them where samples share times by a coarse clock."""
    first = {tuple(cells): i for i, (_, cells) in reversed(list(enumerate(rows)))}
    once = sorted(first.values())
    return once if len(np.unique(t[once])) == len(once) else list(range(len(rows)))


def _pieces(t: Array) -> list[np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """Rows of each record, in the order of time."""
    steps = np.diff(t)
    rising = steps[steps > 0.0]
    period_s = float(np.median(rising)) if len(rising) else 0.0
    back = np.flatnonzero(steps < -max(STEP_BACK_S, STEP_BACK_PERIODS * period_s)) + 1
    pieces = np.split(np.arange(len(t)), back)
    if len(pieces) > MOST_RECORDS or min(map(len, pieces)) < FEWEST_ROWS:
        pieces = [np.arange(len(t))]
    return [piece[np.argsort(t[piece], kind="stable")] for piece in pieces]


def _over_midnight(t: Array) -> Array:
    """Times (n,) [s] of a clock that begins again at midnight, carried on."""
    steps = np.diff(t, prepend=t[:1])
    return array(t + DAY_S * np.cumsum((steps < MINUTE_S - DAY_S) & (steps > -DAY_S)))


def _spread(columns: dict[str, Array], source: str) -> dict[str, Array]:
    """Columns in which rows that share the tick of a coarse clock are spread over it; the same ones where none do.

    Velocity and force stand in the same row, so its place among those of a tick is the time of both. Of the first tick
    there are the last rows, of the last one the first.
    """
    t = columns["t"]
    ticks, starts, counts = np.unique(t, return_index=True, return_counts=True)
    speeds, forces = (
        np.column_stack([columns[name] for name in names if name in columns] or [np.full(len(t), NAN)])
        for names in ("uvwpqr", FORCES)
    )
    whole = np.isfinite(speeds).any(axis=1) & np.isfinite(forces).any(axis=1)
    within = np.diff(t) == 0.0
    moves = (np.diff(speeds, axis=0) != 0.0).any(axis=1)[within]
    few = len(t) < max(FEWEST_ROWS, ROWS_OF_TICK * len(ticks))
    # A velocity that stays the same within a tick has the time, and the force alone changes.
    if few or whole.mean() < SHARE_OF_ROWS or moves.mean() < SHARE_OF_ROWS:
        return columns
    if len(ticks) < 3:
        raise UsageError(
            f"{source}: {len(t)} lines have only {len(ticks)} different times, {ticks[-1] - ticks[0]:g} s apart: their "
            "digits are lost; write the times with more of them"
        )
    lasts_s = np.minimum(np.diff(ticks), MOST_TICKS * np.median(np.diff(ticks)))
    step_s = float(np.median(lasts_s[1:] / counts[1:-1]))
    steps_s = np.concatenate([[step_s], lasts_s[1:] / counts[1:-1], [step_s]])
    begins = np.concatenate([[ticks[1] - step_s * counts[0]], ticks[1:]])
    place = np.arange(len(t)) - np.repeat(starts, counts)
    return columns | {"t": array(np.repeat(begins, counts) + place * np.repeat(steps_s, counts))}


def _together(parts: list[Recording]) -> list[Recording]:
    """Records, of which some stand in pieces with other columns each below the other."""
    records = parts[:1]
    for one in parts[1:]:
        if are_parts(records[-1], one):
            records[-1] = joined(records[-1], one)
        else:
            records.append(one)
    return records


def _rows(text: str, source: str) -> tuple[list[str], list[Row]]:
    """Cells of the header line, and line number and cells of each line below it."""
    count = text.count("\n")
    if count > MOST_LINES:
        raise UsageError(
            f"{source}: found {count} lines, wanted at most {MOST_LINES}; keep the maneuvers only, or every nth line"
        )
    rows = rows_of(text, source, _is_header)
    if len(rows) < 2:
        raise UsageError(
            f"{source}: found {len(rows)} line{'' if len(rows) == 1 else 's'}, "
            "wanted a header line with column names and data below it"
        )
    header = rows[0][1]
    # Files that were put below each other have their header lines still.
    return header, [row for row in rows[1:] if row[1] != header]


def _is_header(line: str) -> bool:
    """Whether a line names the time and another known column."""
    try:
        found = {known.name for cell in from_one(cells_of([line])[0]) if (known := meaning_of(cell))}
    except (UsageError, csv.Error, IndexError):
        return False
    return "t" in found and len(found) > 1


def _meanings(header: list[str], source: str, *, part: bool) -> tuple[dict[int, Meaning], dict[int, OutputColumn]]:
    """Meaning of each used column, and of those of single thrusters where none is a force, by index.

    UsageError when too few, or two mean the same.
    """
    try:
        found = {i: known for i, cell in enumerate(from_one(header)) if (known := meaning_of(cell))}
    except UsageError as error:
        raise UsageError(f"{source}, {error}") from None
    if tuple(header[:2]) == TIME:  # a table of `bag extract`, which names the time of a message in front of its fields
        found = {i: known for i, known in found.items() if i == 1 or known.name not in ("t", NANOSECONDS)}
    usual = {known.name for known in found.values() if not known.gives_way}
    found = {i: known for i, known in found.items() if not (known.gives_way and known.name in usual)}
    # An x and a y without a word may be anything; one beside velocities tells no more than whose axes these have.
    counts = Counter(known.name for known in found.values())
    told = counts["u"] and counts["v"] and counts["px"] == counts["py"] == 1
    found = {i: known for i, known in found.items() if told or not (known.gives_way and known.name in ("px", "py"))}
    # A second quaternion is of a setpoint or of a camera, and none is needed.
    counts = Counter(known.name for known in found.values())
    apart = {name for name in QUATERNION if any(counts[part] != 1 for part in QUATERNION)}
    found = {i: known for i, known in found.items() if known.name not in apart}
    names = [known.name for known in found.values()]
    twice = [header[i] for i, known in found.items() if names.count(known.name) > 1]
    if twice:
        raise UsageError(f"{source}: columns {' and '.join(twice)} mean the same, wanted one; remove the other")
    outputs = {} if set(FORCES) & set(names) else output_columns(header)
    forces = FORCES if outputs else names
    turned = ("roll", "pitch", *(("yaw",) if "vn" not in names else ()))
    shown_by = {*names, *(turned if "qw" in names else ())}
    pairs = [(speed, force) for speed, force in zip("uvwpqr", FORCES, strict=True) if force in forces]
    others: dict[str, tuple[set[str], ...]] = {rate: ({angle},) for angle, rate in ANGLES.items()}
    others |= {"w": ({"depth"}, OF_WORLD | {"vd"}), "u": (PLACE, OF_WORLD), "v": (PLACE, OF_WORLD)}
    usable = [force for speed, force in pairs if any(shown <= shown_by for shown in ({speed}, *others.get(speed, ())))]
    if "t" not in names or not (usable or (part and (outputs or len(names) > 1))):
        raise UsageError(
            f"{source}: found the columns {_listed(header)}; wanted t and at least one pair of velocity and force "
            "of the same axis (u and X, v and Y, w and Z, p and K, q and M, r and N), with the unit where it is not "
            f"SI, such as u_cmps; rename them in the header line{_hint(set(names), header)}"
        )
    return found, outputs


def _hint(names: set[str], header: list[str]) -> str:
    """Remedy for the missing part of a record."""
    if "t" not in names:
        no_time = "; none of them is a time: call it t, with its unit if not seconds, such as t_ms"
        return f"{no_time}; speeds and forces without times are for `./hindrax towing`"
    if {"vn", "ve"} <= names and "yaw" not in names:
        return "; vn and ve are turned into u and v by a column yaw, and with vd, roll and pitch into w: add them"
    header = from_one(header)
    misses = otherwise_recorded(header)
    misses += [miss for cell in header if not meaning_of(cell) and (miss := near_miss(cell))]
    if misses:
        return f"; {'; '.join(misses)}"
    return "" if names & set(FORCES) else f"; forces are missing: name them so, or {OUTPUTS} for {MEANING}"


def _is_data(cell: str) -> bool:
    """Whether a cell may belong to a row of data: a number, even in other digits than ours, a time, or empty."""
    if cell.lstrip("+-.")[:1].isdigit():
        return True
    try:
        time_of(cell)
    except ValueError:
        return False
    return True


def _with_units(header: list[str], rows: list[Row]) -> tuple[list[str], list[str]]:
    """Header line with the units of a line below it in brackets, and that line; empty where there is none."""
    units = rows[0][1]
    known = [i for i, cell in enumerate(from_one(header)[: len(units)]) if _is_known(cell)]
    # Where only one column is known, the table may lie on its side.
    if len(known) < 2 or any(_is_data(units[i]) for i in known):
        return header, []
    plain = [*(unit.strip("()[]") if plain_unit(unit) else "" for unit in units), *[""] * len(header)]
    columns = zip(header, plain, strict=False)
    return [f"{cell} [{unit}]" if unit and not output_of(cell) else cell for cell, unit in columns], units


def _is_known(cell: str) -> bool:
    """Whether a header is that of a known column, be it with a unit that is none of it."""
    try:
        return bool(meaning_of(cell))
    except UsageError:
        return True


def _forces_of_outputs(
    columns: dict[int, OutputColumn], header: list[str], rows: list[Row], source: str, vehicle: Vehicle | None
) -> tuple[dict[str, Array], str, Supply]:
    """Columns (n,) of the thrusters [N] and of the wrench in SNAME axes [N, N m], what was assumed, and the supply."""
    numbers = {index: _values(rows, index, "", f"column {header[index]}", source) for index in columns}
    supply = supply_column(header)
    volts = array(np.full(len(rows), NAN)) if supply is None else _values(rows, supply, "", header[supply], source)
    found = outputs_of(source, columns, numbers, volts)
    vehicle = found.required(vehicle)
    forces = found.forces(vehicle)
    made = {f"{THRUSTER}{number}": array(one) for number, one in enumerate(forces.T)}
    made |= zip(FORCES, wrenches_of_forces(forces, vehicle).T, strict=True)
    supplied = f"at the voltage of {header[supply]}" if supply is not None else "at the supply of the vehicle file"
    how = f", {supplied}" if found.unit != THRUSTER_FORCES else ""
    supply_known = Supply.MEASURED if found.is_supply_measured else Supply.ASSUMED
    return made, f"forces follow from {len(columns)} outputs by the thrusters of the vehicle file{how}", supply_known


def _values(rows: list[Row], index: int, name: str, column: str, source: str) -> Array:
    """Numbers of one column: (n,), in the unit of the file; NaN for empty cells."""
    read: Callable[[str], float] = time_of if name == "t" else number
    out = []
    for line, cells in rows:
        text = cells[index] if index < len(cells) else ""
        try:
            out.append(read(text))
        except ValueError:
            wanted = WANTED_TIME if name == "t" else "a number with a decimal point, or nothing"
            raise UsageError(f"{source}, line {line}, {column}: found {_shown(text)}, wanted {wanted}") from None
    return np.array(out)


def _listed(header: list[str]) -> str:
    """Cells of a header line for an error: a table that lies on its side has thousands."""
    more = f" and {len(header) - MOST_SHOWN} more" if len(header) > MOST_SHOWN else ""
    return ", ".join(cell[:LONGEST_SHOWN] for cell in header[:MOST_SHOWN]) + more


def _shown(text: str) -> str:
    """A cell for an error: what is not of a table may be long."""
    return repr(text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}...")


def _check_times(time: Array, rows: list[Row], source: str) -> None:
    if not np.all(np.isfinite(time)):
        line = rows[int(np.argmin(np.isfinite(time)))][0]
        raise UsageError(f"{source}, line {line}: no time, wanted a number in every line; remove the line")
    if len(time) > 1 and np.ptp(time) == 0.0:
        raise UsageError(f"{source}: all times are the same ({time[0]:g}), wanted increasing times")


def _recording(source: str, columns: dict[str, Array]) -> Recording:
    t = columns["t"]
    origin, empty = float(t[0]), np.full(len(t), NAN)
    way_t, way = _ways(columns, origin)
    if len(way_t) and are_exact(way[:, np.isfinite(way).any(axis=0)]):
        columns = columns | _speeds(columns, way_t + origin, way)
        way_t, way = NO_TIMES, NO_WAYS
    parts = []
    for names in ("uvwpqr", FORCES, ("roll", "pitch", "depth")):
        table = np.stack([columns.get(name, empty) for name in names], axis=1)
        known = np.isfinite(table).any(axis=1)
        parts.append((t[known] - origin, table[known]))
    of_thrusters = [values for name, values in columns.items() if name.startswith(THRUSTER)]
    forces = array(np.column_stack(of_thrusters)) if of_thrusters else NO_FORCES
    # The wrench is known where all of these are.
    forces = forces[np.isfinite(forces).all(axis=1)]
    recording = Recording(source, *parts[0], *parts[1], *parts[2], origin, (), way_t, way, forces)
    return _with_rates_of_angles(recording, columns)


def _rated(columns: Collection[str]) -> list[str]:
    """Angles whose rate the file does not have, where it has the moment about their axis."""
    moments = zip(ANGLES.items(), FORCES[3:], strict=True)
    return [angle for (angle, rate), moment in moments if {angle, moment} <= set(columns) and rate not in columns]


def _with_rates_of_angles(recording: Recording, columns: dict[str, Array]) -> Recording:
    """The record with the rates of the angles that are the only motion beside a moment."""
    angles = {name: columns[name] for name in _rated(columns)}
    known = np.isfinite(np.column_stack(list(angles.values()))).all(axis=1) if angles else np.zeros(0, dtype=bool)
    if known.sum() < FEWEST_ROWS:
        return recording
    # An angle that is not there, or not known, is level.
    level = np.zeros(int(known.sum()))
    turned = [np.nan_to_num(columns[name][known]) if name in columns else level for name in ("yaw", "pitch", "roll")]
    attitudes = array(Rotation.from_euler("ZYX", np.column_stack(turned)).as_quat())
    t, nu = velocities_from_poses(columns["t"][known] - recording.origin_s, np.zeros((len(level), 3)), attitudes)
    nu[:, :3] = NAN
    for axis, (name, _) in enumerate(ANGLES.items(), start=3):
        nu[:, axis] = nu[:, axis] if name in angles else NAN
    times = np.concatenate([recording.velocity_t, t])
    order = np.argsort(times, kind="stable")
    velocity = array(np.concatenate([recording.velocity, nu])[order])
    return replace(recording, velocity_t=array(times[order]), velocity=velocity)


def _ways(columns: dict[str, Array], origin: float) -> tuple[Array, Array]:
    """Times (n,) [s] and ways (n, 3) [m] along the axes whose velocity the file does not have."""
    if not set(columns) >= PLACE:
        return NO_TIMES, NO_WAYS
    x, y, half = columns["px"], columns["py"], 0.5 * columns["yaw"]
    known, none = np.isfinite(x + y + half), np.zeros_like(x)
    attitudes = np.column_stack([none, none, np.sin(half), np.cos(half)])
    ways = ways_from_poses(np.column_stack([x, y, none])[known], attitudes[known])
    measured = [speed in columns for speed in "uv"]
    return columns["t"][known] - origin, np.where([*measured, True], NAN, ways)


def _speeds(columns: dict[str, Array], t: Array, way: Array) -> dict[str, Array]:
    """Columns of the velocities that exact ways (n, 3) at times (n,) have."""
    found = {}
    for speed, along in zip("uv", way.T[:2], strict=True):
        if speed not in columns:
            rates = np.gradient(along, t)
            found[speed] = np.where(np.isin(columns["t"], t), np.interp(columns["t"], t, rates), NAN)
    return found
