"""Third-party bags: topics and axes of velocity and force, and the record made of them.

Topics are found by type. Ambiguous axes follow REP-103 and REP-105, and are reported as assumptions.
"""

import fnmatch
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hindrax_analysis.records.bag_track import (
    BATTERY,
    COMPARED_S,
    DOPPLER_TYPES,
    NAMED_VELOCITY_TYPES,
    PRESSURE,
    UNKNOWN,
    VELOCITY_TYPES,
    WRENCH_TYPES,
    Track,
    are_exact,
    compare_frames,
    compare_rates,
    quaternions_of,
    steps_back,
    tilts_of,
    to_body,
    velocities_from_poses,
    ways_from_poses,
)
from hindrax_analysis.records.recording import HALF_TURN, NO_FORCES, NO_TIMES, NO_WAYS, Recording, wrenches_of_forces
from hindrax_analysis.records.thruster_values import (
    EACH,
    FIELDS,
    FORCES,
    PULSES,
    UNITS,
    ThrusterValues,
    forces_of_thrusters,
    is_connected,
    supplies_at,
)
from hindrax_bag.read.bag_reader import DamagedMessageError, messages
from hindrax_bag.read.mcap_records import Damage
from hindrax_control.allocation.thrust_curve import PULSE_FIELDS, WRAPS
from hindrax_core.errors import UsageError
from hindrax_core.hydrostatics import Water
from hindrax_core.topics import ALLOCATION, MANEUVER, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, Index, array

FEWEST_MESSAGES = 20
"""Fewer velocities than this between steps back of the stamps are no record."""
IMU = "sensor_msgs/msg/Imu"
OF_AIR = ("/static_pressure", "/diff_pressure")
"""Ends of topics with pressures that say nothing of the depth."""
LEAST_Pa = 50_000.0
"""Less than the pressure of the air on any lake."""
LEAST_DIVE_m = 0.1
"""Range of depths from which a pressure is that of the water: the air in a hull is warmed, too."""
UPRIGHT_rad = 0.5
"""Tilts below which roll and pitch change by the rates about their axes, nearly."""
STILL_rad = 0.02
"""Differences below this are those of noise, of a vehicle that hardly tilts."""
VELOCITY = ("velocity", "--odometry")
"""What is looked for, and the option that names it."""
FRAMES = ("flu", "fsd", "world")
DOWN_WORDS = {"fsd", "frd", "ned", "sname"}
"""Words in the name of a frame whose z axis points down."""
UP_WORDS = {"flu", "enu"}
"""Words in the name of a frame whose z axis points up."""
WORLD_WORDS = {"odom", "map", "world", "earth", "enu", "utm", "global"}


@dataclass(frozen=True, slots=True)
class TopicSelection:
    """Topics by name, or empty to find them by type; axes, or empty to infer them from the frames."""

    odometry: str = ""
    wrench: str = ""
    frame: str = ""


@dataclass(frozen=True, slots=True)
class _FrameChoice:
    """The named axes, notes on the axes assumed, and a world of the odometry that points down; empty: it does not."""

    frame: str
    notes: list[str]
    world_down: str = ""

    @property
    def is_given(self) -> bool:
        """Whether the body axes of all topics are named."""
        return self.frame in ("flu", "fsd")


def topics_of(bag: Path, damage: Damage | None = None) -> dict[str, str]:
    """Type of every topic with messages; `damage` receives a report of what was left out."""
    found: dict[str, str] = {}
    for message in messages(bag, damage=damage):
        if message.topic not in found:
            package, _, short = message.type.replace("/msg/", "/").partition("/")
            found[message.topic] = f"{package}/msg/{short}"
    return found


def listed(topics: Mapping[str, str]) -> str:
    """The topics and their types, for a sentence."""
    return ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items())) or "nothing"


def is_ours(topics: Mapping[str, str]) -> bool:
    """Whether a bag was recorded by this stack: it has the maneuver and the achieved wrench."""
    return resolved(ALLOCATION) in topics and resolved(MANEUVER) in topics


def read_bag(
    bag: Path, wanted: TopicSelection, topics: Mapping[str, str], vehicle: Vehicle | None = None
) -> list[Recording]:
    """Read a third-party bag. Stamps that step back begin another record: a simulator was reset, a clock began again.

    Parameters
    ----------
    bag, topics
        Folder, and its topics with their types.
    wanted
        Topics and body axes, where they are not clear. UsageError, with a list of the topics, where one is missing or
        ambiguous.
    vehicle
        Converts pulses to newtons; None: not known.

    Returns
    -------
    list[Recording]
        In SNAME axes, SI.

    Raises
    ------
    UsageError
        Names a topic of which no message can be decoded.
    """
    # What a navigator made of a Doppler log comes before the log itself.
    there = set(topics.values())
    alone = not there.isdisjoint(DOPPLER_TYPES) and there.isdisjoint(VELOCITY_TYPES)
    direct, also = (DOPPLER_TYPES, ()) if alone else (VELOCITY_TYPES, DOPPLER_TYPES)
    velocity = _choose(bag, topics, (direct, (*NAMED_VELOCITY_TYPES, *also)), wanted.odometry, VELOCITY)
    named = ThrusterValues.named(wanted.wrench)
    possible = tuple({*PULSE_FIELDS, topics[named.topic]} if named.field and named.topic in topics else PULSE_FIELDS)
    each = _topics_of_each(bag, topics, named.topic)
    wrench = named.topic if each else _choose(bag, topics, (WRENCH_TYPES, possible), named.topic, ("force", "--wrench"))
    gyros = [name for name, kind in topics.items() if kind == IMU and name not in (velocity, wrench)]
    # Of MAVROS, these are pressures of the air in the hull.
    pressures = [name for name, kind in topics.items() if kind == PRESSURE and not name.endswith(OF_AIR)]
    batteries = [name for name, kind in topics.items() if kind == BATTERY]
    of_thrust = each or [wrench]
    tracks = {name: Track(name, topics[name]) for name in (velocity, *of_thrust, *gyros, *pressures, *batteries)}
    for name in of_thrust:
        if named.path(topics[name]):
            usual = FORCES if topics[name] in FIELDS else PULSES if topics[name].startswith("mavros_msgs/") else ""
            tracks[name].values = replace(named, topic=wrench, unit=named.unit or usual)
    damage = Damage()
    for message in messages(bag, set(tracks), damage=damage):
        try:
            tracks[message.topic].add(message)
        except DamagedMessageError as error:
            damage.skip(str(error), message.received, message.received)
    if each:
        tracks[wrench] = _together(wrench, [tracks.pop(name) for name in each])
    for track in (tracks[velocity], tracks[wrench]):
        if not track.received:
            raise UsageError(f"{bag}: none of the messages of {track.topic} can be decoded; record it again")
    supplied, notes = _supplied(tracks[wrench], [tracks[name] for name in batteries], vehicle)
    parts = _parts(tracks[velocity], supplied)
    steps = "once" if len(parts) == 2 else f"{len(parts) - 1} times"
    back = [f"the stamps of {velocity} step back {steps}: {len(parts)} records"] if len(parts) > 1 else []
    found = [_recording(bag, v, w, wanted.frame, vehicle) for v, w in parts]
    if len(parts) == 1 and gyros and not np.nan_to_num(found[0].velocity[:, 3:]).any():
        found = [_with_inertial(found[0], [tracks[name] for name in gyros], wanted.frame, velocity)]
    if len(parts) == len(pressures) == 1 and not np.isfinite(found[0].attitude[:, 2:]).any():
        found = [_with_depths(found[0], tracks[pressures[0]], vehicle.water if vehicle else Water())]
    return [replace(one, assumptions=(*one.assumptions, *notes, *back, *damage.sentences)) for one in found]


def _topics_of_each(bag: Path, topics: Mapping[str, str], named: str) -> list[str]:
    """Topics of a name with a star, one per thruster, in the order of their numbers; empty for another name."""
    if EACH not in named:
        return []
    found = fnmatch.filter(topics, named)
    if not found:
        raise UsageError(f"--wrench {named}: found no such topic; {bag} holds {listed(topics)}")
    return sorted(found, key=lambda topic: ([*map(int, re.findall(r"\d+", topic))], topic))


def _together(topic: str, each: list[Track]) -> Track:
    """One topic out of those of the thrusters: at each of their times what all of them have said last."""
    said = sorted(
        (received, stamped, channel, row[0])
        for channel, track in enumerate(each)
        for received, stamped, row in zip(track.received, track.stamped, track.rows, strict=True)
    )
    last: dict[int, float] = {}
    rows: list[tuple[int, int, list[float]]] = []
    for received, stamped, channel, value in said:
        last[channel] = value
        if len(last) == len(each):
            if rows and (rows[-1][0] or rows[-1][1]) == (stamped or received):
                rows.pop()
            rows.append((stamped, received, [last[number] for number in range(len(each))]))
    stamps, receipts, values = (list(column) for column in zip(*rows, strict=True)) if rows else ([], [], [])
    return replace(each[0], topic=topic, stamped=stamps, received=receipts, rows=values)


def _way_of_each(topics: Iterable[str]) -> str:
    """Remedy where several topics differ only by a number, as those of thrusters; empty where none do."""
    forms = [re.sub(r"\d+(?=\D*$)", EACH, topic) for topic in topics]
    several = [form for form in dict.fromkeys(forms) if EACH in form and forms.count(form) > 1]
    return f"; one topic per thruster is named as --wrench '{several[0]}=N' (N, us or ratio)" if several else ""


def _choose(
    bag: Path, topics: Mapping[str, str], types: tuple[tuple[str, ...], tuple[str, ...]], named: str,
    words: tuple[str, str],
) -> str:  # fmt: skip
    """The named topic, or the only one of the first types; topics of the second types have to be named."""
    (automatic, only_named), (what, option) = types, words
    fitting = sorted(topic for topic, kind in topics.items() if kind in automatic)
    possible = sorted(topic for topic, kind in topics.items() if kind in only_named)
    there = listed(topics)
    short = " or ".join(kind.partition("/msg/")[2] for kind in automatic)
    if named:
        if named in fitting or named in possible:
            return named
        found = topics.get(named, "no such topic")
        raise UsageError(f"{option} {named}: found {found}, wanted {short}; {bag} holds {there}")
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        each = _way_of_each(fitting) if option == "--wrench" else ""
        several = f"{bag}: several topics may hold the {what}: {', '.join(fitting)}"
        raise UsageError(f"{several}; name one with {option}{each}")
    if possible:
        makeshift = "pulses" if option == "--wrench" else "poses, rates or commands"
        raise UsageError(
            f"{bag}: no topic holds the {what} ({short}); {' or '.join(possible)} may serve if it holds {makeshift}: "
            f"name it with {option}; the bag holds {there}"
        )
    way = "; what other messages hold can be written as CSV (`./hindrax bag extract`), and its columns named"
    if option == "--wrench":
        each = _way_of_each(topic for topic in topics if topics[topic] not in VELOCITY_TYPES)
        way = each or f"; an array with a number per thruster is named as --wrench TOPIC:FIELD=N (N, us or ratio){way}"
    raise UsageError(f"{bag}: no topic holds the {what} ({short}); it holds {there}{way if topics else ''}")


# ---- axes and times


def _parts(velocity: Track, wrench: Track) -> list[tuple[Track, Track]]:
    """Both topics, or their parts between the steps back of the stamps of the velocities."""
    back, also = steps_back(velocity.stamped), steps_back(wrench.stamped)
    if len(also) != len(back):
        also = np.searchsorted(wrench.received, [velocity.received[i] for i in back]).tolist()
    parts = list(zip(velocity.parted(back), wrench.parted(also), strict=True))
    long = [(v, w) for v, w in parts if len(v.received) >= FEWEST_MESSAGES and w.received]
    return long if len(long) > 1 or (back and long) else [(velocity, wrench)]


def _supplied(thrust: Track, batteries: Sequence[Track], vehicle: Vehicle | None) -> tuple[Track, list[str]]:
    """Pulses with the supply that a battery had as they were received, the first that measured any; and notes."""
    if thrust.values is None or thrust.values.unit == FORCES or vehicle is None:
        return thrust, []
    measured = [(array(1e-9 * np.array(one.received)), array(np.ravel(one.rows))) for one in batteries]
    times, volts = next(filter(lambda one: is_connected(one[1]).any(), measured), (NO_TIMES, NO_TIMES))
    found = supplies_at(array(1e-9 * np.array(thrust.received)), times, volts, vehicle)
    return replace(thrust, supplies_V=found.volts, supply=found.known), [found.note]


def _recording(bag: Path, velocity: Track, wrench: Track, frame: str, vehicle: Vehicle | None) -> Recording:
    down = bool(_words(velocity.world) & DOWN_WORDS)
    axes = _FrameChoice(frame, [], velocity.world if down else "")
    t_v, t_w = _times(velocity, wrench, axes.notes)
    origin = min(t_v.min(), t_w.min())
    v, w = np.argsort(t_v, kind="stable"), np.argsort(t_w, kind="stable")
    at_v, at_w = (1e-9 * (t[order] - origin).astype(float) for t, order in ((t_v, v), (t_w, w)))
    poses: tuple[Array, Array] | None = None
    if velocity.poses:
        poses = array(np.array(velocity.poses)[v, :3]), quaternions_of(velocity)[v]
    moving_t, moving = _velocities(velocity, v, at_v, poses, axes)
    signs = _signs_to_sname(velocity, axes)
    way_t, way = NO_TIMES, NO_WAYS
    if poses and not velocity.rows:
        known = np.isfinite(poses[1]).all(axis=1)
        ways = ways_from_poses(poses[0][known], poses[1][known])
        if not are_exact(ways):
            way_t, way = array(at_v[known]), ways
    tilts = NO_WAYS
    if poses and velocity.kind == IMU:
        tilts = _tilts_of_inertial(velocity, at_v, moving * signs, signs, axes.notes)
    elif poses and _is_estimated(angles := tilts_of(poses[1])):
        tilts = array(np.column_stack([angles * [1.0, signs[1]], np.full(len(at_v), np.nan)]))
    wrenches, forces = _forces(wrench, velocity, signs, axes, vehicle)
    return Recording(
        source=str(bag),
        velocity_t=moving_t,
        velocity=array(moving * signs),
        wrench_t=array(at_w),
        wrench=wrenches[w],
        attitude_t=array(at_v) if len(tilts) else NO_TIMES,
        attitude=tilts,
        origin_s=1e-9 * float(origin),
        assumptions=tuple(axes.notes),
        way_t=way_t,
        way=array(way * signs[:3]),
        forces=forces[w] if len(forces) else NO_FORCES,
        supply=wrench.supply,
    )


def _with_inertial(record: Recording, sensors: list[Track], frame: str, velocity: str) -> Recording:
    """The record with rates and attitude of an inertial sensor, where its topic of velocities has none.

    A Doppler log fills the rates of a Twist with zeros, which nobody has measured. Of several sensors it is the one
    that knows its attitude: MAVROS publishes its raw numbers, too.
    """
    moving = record.velocity.copy()
    moving[:, 3:] = UNKNOWN
    record = replace(record, velocity=array(moving))
    oriented = [one for one in sensors if np.isfinite(np.array(one.poses or [[UNKNOWN] * 7])[:, 3:]).any()]
    clear = oriented if len(oriented) == 1 else sensors
    if len(clear) != 1:
        names = ", ".join(one.topic for one in sensors)
        note = f"{velocity} has no rates, and it is not clear which of {names} to take: none; record one of them"
        return replace(record, assumptions=(*record.assumptions, note))
    (sensor,) = clear
    at_s = _times_within(record, sensor)
    if not len(at_s):
        return record
    axes = _FrameChoice(frame if frame != "world" else "", [])
    signs = _signs_to_sname(sensor, axes)
    rows = np.array(sensor.rows) * signs
    tilted = _tilts_of_inertial(sensor, at_s, rows, signs, axes.notes)
    t = np.concatenate([record.velocity_t, at_s])
    order = np.argsort(t, kind="stable")
    has_attitude = bool(len(record.attitude_t)) or not len(tilted)
    notes = (f"{velocity} has no rates: those of {sensor.topic}", *axes.notes)
    return replace(
        record,
        velocity_t=array(t[order]),
        velocity=array(np.concatenate([moving, rows])[order]),
        attitude_t=record.attitude_t if has_attitude else at_s,
        attitude=record.attitude if has_attitude else tilted,
        assumptions=(*record.assumptions, *notes),
    )


def _times_within(record: Recording, sensor: Track) -> Array:
    """Times (n,) [s] of another topic in a record, by its stamps, else by receipt; none where it is of another time."""
    times = (1e-9 * np.array(one, dtype=float) - record.origin_s for one in (sensor.stamped, sensor.received))
    return next((array(t) for t in times if len(t) and t[0] < record.end_s and t[-1] > record.begin_s), NO_TIMES)


def _is_estimated(tilts: Array) -> bool:
    """Whether roll and pitch (n, 2) ever change: many a driver leaves a constant where nobody has estimated them."""
    known = tilts[np.isfinite(tilts).all(axis=1)]
    return bool(len(known)) and bool(np.ptp(known, axis=0).any())


def _tilts_of_inertial(sensor: Track, t: Array, rows: Array, signs: Array, notes: list[str]) -> Array:
    """Roll, pitch and no depth of an inertial sensor, (n, 3); (0, 3) where its orientation is not that of its rates.

    One that is estimated changes by what the rates add up to: over COMPARED_S for small angles, which others are not
    compared.
    """
    tilts = tilts_of(quaternions_of(sensor)) * np.array([1.0, signs[1]])
    known = np.flatnonzero(np.isfinite(tilts).all(axis=1))
    if len(known) < FEWEST_MESSAGES or not _is_estimated(tilts):
        return NO_WAYS
    upright = np.abs(tilts[known]).max(axis=1) < UPRIGHT_rad
    turned = np.concatenate([np.zeros((1, 2)), np.cumsum(np.diff(t[known])[:, None] * rows[known][1:, 3:5], axis=0)])
    ends = np.minimum(np.searchsorted(t[known], t[known] + COMPARED_S), len(known) - 1)
    compared = upright & upright[ends]
    if not compared.any():
        return NO_WAYS
    by_rates, by_angles = (one[ends][compared] - one[compared] for one in (turned, tilts[known]))
    if not np.mean((by_angles - by_rates) ** 2) < max(STILL_rad**2, 0.5 * float(np.mean(by_rates**2))):
        notes.append(f"{sensor.topic}: its orientation does not change as its rates say, and is not used")
        return NO_WAYS
    return array(np.column_stack([tilts, np.full(len(tilts), np.nan)]))


def _with_depths(record: Recording, sensor: Track, water: Water) -> Recording:
    """The record with the depths of a pressure sensor; unchanged where the pressure hardly changes, as in a hull.

    The message is in pascal; many a driver fills in hectopascal (millibar), which no water has as a pressure in pascal.
    """
    pressure = np.array(sensor.rows or [[UNKNOWN]])[:, 0]
    known = np.isfinite(pressure)
    in_hectopascal = known.any() and float(np.median(pressure[known])) < LEAST_Pa
    depths = [water.depth_m(one) for one in (pressure * (100.0 if in_hectopascal else 1.0)).tolist()]
    at_s = _times_within(record, sensor)
    if not len(at_s) or not np.ptp(np.array(depths)[known]) > LEAST_DIVE_m:
        return record
    rows = np.full((int(known.sum()), 3), np.nan)
    rows[:, 2] = np.array(depths)[known]
    t = np.concatenate([record.attitude_t, at_s[known]])
    order = np.argsort(t, kind="stable")
    unit = ", taken as hectopascal by their size" if in_hectopascal else ""
    note = f"depths follow from the pressures of {sensor.topic}{unit}"
    return replace(
        record,
        attitude_t=array(t[order]),
        attitude=array(np.concatenate([record.attitude.reshape(-1, 3), rows])[order]),
        assumptions=(*record.assumptions, note),
    )


def _forces(
    wrench: Track, velocity: Track, signs: Array, axes: _FrameChoice, vehicle: Vehicle | None
) -> tuple[Array, Array]:
    """Wrenches in SNAME axes, and forces of the thrusters if it has those: (n, 6) [N, N m], (n, k) [N], as received."""
    if wrench.values is not None:
        unit = wrench.values.unit_of(wrench.rows)
        axes.notes.append(f"{wrench.topic} holds one value per output channel: {UNITS[unit]}")
        if vehicle is None or not vehicle.thrusters:
            remedy = "name a vehicle file with thrusters and curves by --vehicle"
            raise UsageError(f"{wrench.topic}: holds values of single thrusters, wanted a wrench; {remedy}")
        forces = forces_of_thrusters(wrench.values, wrench.rows, vehicle, wrench.supplies_V)
        return wrenches_of_forces(forces, vehicle), forces
    if wrench.frame or axes.is_given or velocity.kind in DOPPLER_TYPES:
        signs = _signs_to_sname(wrench, axes)
    else:
        axes.notes.append(f"{wrench.topic} names no frame: it is in the axes of {velocity.topic}")
    axes.notes.append(f"{wrench.topic} is the wrench achieved by the thrusters, about the center of mass")
    return array(np.array(wrench.rows) * signs), NO_FORCES


def _velocities(
    track: Track, order: Index, at_s: Array, poses: tuple[Array, Array] | None, axes: _FrameChoice
) -> tuple[Array, Array]:
    """Times, (n,) [s], and velocities, (n, 6) [m/s, rad/s], in body axes of either convention."""
    if not track.rows and poses is not None:
        known = np.isfinite(poses[1]).all(axis=1)
        if known.sum() < 2:
            raise UsageError(f"{track.topic}: holds no attitudes, wanted unit quaternions with the positions")
        axes.notes.append(
            f"{track.topic} holds no velocities: its positions are fitted, and rates derived from its attitudes"
        )
        return velocities_from_poses(array(at_s[known]), poses[0][known], poses[1][known])
    rows = array(np.array(track.rows)[order])
    if _in_world(track, at_s, rows, poses, axes) and poses is not None:
        moving, rates, world = to_body(rows[:, :3], poses[1]), rows[:, 3:], compare_rates(at_s, poses[1], rows[:, 3:])
        if world is not None and world.is_world:
            axes.notes.append(f"{track.topic}: its rates as well: its attitude changes so")
            rates = to_body(rates, poses[1])
        rows = array(np.column_stack([moving, rates]))
    return array(at_s), rows


def _in_world(track: Track, at_s: Array, rows: Array, poses: tuple[Array, Array] | None, axes: _FrameChoice) -> bool:
    """Whether velocities are in world axes and have to be rotated into body axes."""
    if axes.is_given:
        return False
    named_world = axes.frame == "world" or bool(_words(track.frame) & WORLD_WORDS)
    if poses is None or not np.isfinite(poses[1]).all(axis=1).any():
        if named_world:
            raise UsageError(
                f"{track.topic}: is in frame {track.frame!r} without an attitude to turn it by, wanted a frame of the "
                "body such as base_link; if it is in body axes, add --frame flu or --frame fsd"
            )
        return False
    found = compare_frames(at_s, *poses, rows[:, :3])
    if not named_world and found is not None and found.is_neither and found.still > 0.0:
        axes.notes.append(f"{track.topic}: suspect, its velocities contradict the change of its positions in any axes")
    if named_world or (found is not None and found.is_world):
        why = "as named" if named_world else f"not of {track.frame or 'the body'}: its positions change so"
        note = f"velocities taken in the axes of the world, {why}, and turned by its attitude"
        axes.notes.append(f"{track.topic}: {note}")
        return True
    return False


def _words(frame: str) -> set[str]:
    return set(frame.rpartition("/")[2].lower().replace("-", "_").split("_"))


def _signs_to_sname(track: Track, axes: _FrameChoice) -> Array:
    """Signs from the body axes of a topic to SNAME: (6,)."""
    if axes.is_given:
        axes.notes.append(f"{track.topic}: taken as {axes.frame.upper()} axes, as named")
        return array(np.ones(6) if axes.frame == "fsd" else HALF_TURN)
    words = _words(track.frame)
    if words & WORLD_WORDS and track.kind in WRENCH_TYPES:
        raise UsageError(
            f"{track.topic}: is in frame {track.frame!r}, wanted a frame of the body such as base_link; "
            "if it is in body axes, add --frame flu or --frame fsd"
        )
    if track.kind in DOPPLER_TYPES and not words & UP_WORDS:
        axes.notes.append(f"{track.topic}: axes of the instrument, x forward, y starboard, z down")
        return array(np.ones(6))
    if words & DOWN_WORDS:
        axes.notes.append(f"{track.topic}: frame {track.frame!r} taken as x forward, y starboard, z down")
        return array(np.ones(6))
    if axes.world_down and not words & UP_WORDS:
        found = f"the world of the odometry is {axes.world_down!r}"
        axes.notes.append(f"{track.topic}: {found}, so it is taken as x forward, y starboard, z down")
        return array(np.ones(6))
    called = f"frame {track.frame!r}" if track.frame else "no frame is named, so it is"
    axes.notes.append(f"{track.topic}: {called} taken as x forward, y left, z up (REP-103), and turned to z down")
    return array(HALF_TURN.copy())


def _unwrapped(velocity: Track, wrench: Track, notes: list[str]) -> list[int]:
    """Stamps of a wrench [ns], those that began again put right: by receipt both topics are equally late."""
    wrap = WRAPS.get(wrench.kind, 0)
    if not wrap:
        return wrench.stamped
    usual = float(np.median(np.array(velocity.received) - np.array(velocity.stamped)))
    late = [at - stamp - usual for at, stamp in zip(wrench.received, wrench.stamped, strict=True)]
    times = [round(one / wrap) for one in late]
    if any(times):
        notes.append(f"the stamps of {wrench.topic} began again after {wrap / 60e9:.1f} minutes: put right")
    return [stamp + wrap * one for stamp, one in zip(wrench.stamped, times, strict=True)]


def _times(velocity: Track, wrench: Track, notes: list[str]) -> tuple[Array, Array]:
    """Times of both topics, (n,) and (m,) [ns], on one clock: stamps where both have them, else receipt."""
    stamps = np.array(velocity.stamped), np.array(wrench.stamped)
    if all(len(one) and one.min() > 0 for one in stamps):
        stamps = stamps[0], np.array(_unwrapped(velocity, wrench, notes))
        (a, b), (c, d) = ((one.min(), one.max()) for one in stamps)
        if a < d and c < b:
            return stamps
        notes.append("the stamps of both topics do not overlap: times of receipt are used")
    else:
        bare = velocity.topic if min(velocity.stamped, default=0) <= 0 else wrench.topic
        notes.append(f"{bare} has no stamps: times of receipt are used for both topics")
    return np.array(velocity.received), np.array(wrench.received)
