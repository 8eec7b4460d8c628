"""Bags that this stack has not made: which topics hold velocity and force, in which axes, and a record out of them.

Topics are found by their types. What cannot be known for sure is decided by the rules of REP-103 and REP-105, and said.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hindrax_bag.reader import messages
from hindrax_bringup.tracks import (
    NAMED_VELOCITY_TYPES,
    PULSE_FIELDS,
    VELOCITY_TYPES,
    WRENCH_TYPES,
    Track,
    quaternions_of,
    tilts_of,
    wrenches_of,
)
from hindrax_core.errors import UsageError
from hindrax_core.topics import ALLOCATION, MANEUVER, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.poses import derived, read_axes, to_body
from hindrax_ident.readers import HALF_TURN, Recording

FRAMES = ("flu", "fsd", "world")
DOWN_WORDS = {"fsd", "frd", "ned", "sname"}
"""Words in the name of a body frame whose z axis points down."""
WORLD_WORDS = {"odom", "map", "world", "earth", "enu", "utm", "global"}


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for: topics by name, or empty to find them by type; axes, or empty to tell by the frames."""

    odometry: str = ""
    wrench: str = ""
    frame: str = ""


@dataclass(frozen=True, slots=True)
class _Axes:
    """The axes that were asked for, and what is said of those that were taken."""

    frame: str
    said: list[str]

    @property
    def sure(self) -> bool:
        """Whether the body axes of all topics were told."""
        return self.frame in ("flu", "fsd")


def topics_of(bag: Path) -> dict[str, str]:
    """Type of every topic of a bag that has messages."""
    found: dict[str, str] = {}
    for message in messages(bag):
        if message.topic not in found:
            found[message.topic] = _plain_type(message.type)
    return found


def _plain_type(name: str) -> str:
    """A type as `package/msg/Type`, however it was written."""
    package, _, short = name.replace("/msg/", "/").partition("/")
    return f"{package}/msg/{short}"


def is_ours(topics: Mapping[str, str]) -> bool:
    """Whether a bag was recorded by this stack: it holds the maneuver and the achieved wrench."""
    return resolved(ALLOCATION) in topics and resolved(MANEUVER) in topics


def read_bag(bag: Path, wanted: Wanted, topics: Mapping[str, str], vehicle: Vehicle | None = None) -> Recording:
    """Record of a bag of others. UsageError, with a list of what is there, where topics are missing or ambiguous.

    `vehicle` makes newtons of pulses, where the force is given as pulses.
    """
    velocity = _choose(bag, topics, (VELOCITY_TYPES, NAMED_VELOCITY_TYPES), wanted.odometry, ("velocity", "--odometry"))
    wrench = _choose(bag, topics, (WRENCH_TYPES, tuple(PULSE_FIELDS)), wanted.wrench, ("force", "--wrench"))
    tracks = {name: Track(name, topics[name]) for name in (velocity, wrench)}
    for message in messages(bag, set(tracks)):
        tracks[message.topic].take(message)
    return _recording(bag, tracks[velocity], tracks[wrench], wanted.frame, vehicle)


def _choose(
    bag: Path, topics: Mapping[str, str], types: tuple[tuple[str, ...], tuple[str, ...]], named: str,
    words: tuple[str, str],
) -> str:  # fmt: skip
    """The topic that was named, or the only one of the first kind of types; those of the second have to be named."""
    (sure, perhaps), (what, option) = types, words
    fitting = sorted(topic for topic, kind in topics.items() if kind in sure)
    possible = sorted(topic for topic, kind in topics.items() if kind in perhaps)
    there = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items())) or "nothing"
    short = " or ".join(kind.partition("/msg/")[2] for kind in sure)
    if named:
        if named in fitting or named in possible:
            return named
        found = topics.get(named, "no such topic")
        raise UsageError(f"{option} {named}: found {found}, wanted {short}; {bag} holds {there}")
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise UsageError(f"{bag}: several topics may hold the {what}: {', '.join(fitting)}; name one with {option}")
    if possible:
        makeshift = "pulses" if option == "--wrench" else "poses, rates or commands"
        raise UsageError(
            f"{bag}: no topic holds the {what} ({short}); {' or '.join(possible)} may serve if it holds {makeshift}: "
            f"name it with {option}; the bag holds {there}"
        )
    raise UsageError(f"{bag}: no topic holds the {what} ({short}); it holds {there}")


# ---- axes and times


def _recording(bag: Path, velocity: Track, wrench: Track, frame: str, vehicle: Vehicle | None) -> Recording:
    axes = _Axes(frame, [])
    t_v, t_w = _times(velocity, wrench, axes.said)
    origin = min(t_v.min(), t_w.min())
    v, w = np.argsort(t_v, kind="stable"), np.argsort(t_w, kind="stable")
    at_v, at_w = (1e-9 * (t[order] - origin).astype(float) for t, order in ((t_v, v), (t_w, w)))
    poses = _poses(velocity, v)
    moving_t, moving = _velocities(velocity, v, at_v, poses, axes)
    turn = _turn(velocity, axes)
    tilts = np.column_stack([tilts_of(poses[1]), np.full(len(at_v), np.nan)]) if poses else np.zeros((0, 3))
    return Recording(
        source=str(bag),
        velocity_t=moving_t,
        velocity=array(moving * turn),
        wrench_t=array(at_w),
        wrench=_forces(wrench, velocity, turn, axes, vehicle)[w],
        attitude_t=array(at_v) if poses else np.zeros(0),
        attitude=array(tilts * np.array([1.0, turn[1], 1.0])),
        origin_s=1e-9 * float(origin),
        assumptions=tuple(axes.said),
    )


def _forces(wrench: Track, velocity: Track, turn: Array, axes: _Axes, vehicle: Vehicle | None) -> Array:
    """Rows of the wrench in SNAME axes, in the order of the bag."""
    if wrench.kind in PULSE_FIELDS:
        forces = wrenches_of(wrench, vehicle)
        axes.said.append(f"{wrench.topic} holds pulses of the channels, made newtons by the curves of the vehicle file")
        return forces
    if wrench.frame or axes.sure:
        turn = _turn(wrench, axes)
    else:
        axes.said.append(f"{wrench.topic} names no frame: taken to be in the axes of {velocity.topic}")
    axes.said.append(
        f"{wrench.topic} is taken to be the wrench that the thrusters really made, about the center of mass"
    )
    return array(np.array(wrench.rows) * turn)


def _poses(velocity: Track, order: Index) -> tuple[Array, Array] | None:
    """Positions (n, 3) and attitudes (n, 4) in the order of time; None where the topic has none."""
    if not velocity.poses:
        return None
    return array(np.array(velocity.poses)[order, :3]), quaternions_of(velocity)[order]


def _velocities(
    track: Track, order: Index, at_s: Array, poses: tuple[Array, Array] | None, axes: _Axes
) -> tuple[Array, Array]:
    """Times and velocities (n, 6) in the axes of the body, whichever way they point."""
    if not track.rows and poses is not None:
        known = np.isfinite(poses[1]).all(axis=1)
        if known.sum() < 2:
            raise UsageError(f"{track.topic}: holds no attitudes, wanted unit quaternions beside the positions")
        axes.said.append(f"{track.topic} holds no velocities: they are made of the change of its poses")
        return derived(array(at_s[known]), poses[0][known], poses[1][known])
    rows = array(np.array(track.rows)[order])
    if _in_world(track, at_s, rows, poses, axes) and poses is not None:
        rows = array(np.column_stack([to_body(rows[:, :3], poses[1]), rows[:, 3:]]))
    return array(at_s), rows


def _in_world(track: Track, at_s: Array, rows: Array, poses: tuple[Array, Array] | None, axes: _Axes) -> bool:
    """Whether velocities have to be turned into the axes of the body."""
    if axes.sure:
        return False
    told = axes.frame == "world" or bool(_words(track.frame) & WORLD_WORDS)
    if poses is None or not np.isfinite(poses[1]).all(axis=1).any():
        if told:
            raise UsageError(
                f"{track.topic}: is in frame {track.frame!r} without an attitude to turn it by, wanted a frame of the "
                "body such as base_link; if it is in body axes after all, say so with --frame flu or --frame fsd"
            )
        return False
    found = read_axes(at_s, *poses, rows[:, :3])
    if not told and found is not None and found.is_neither and found.still > 0.0:
        axes.said.append(f"{track.topic}: suspect, its positions change otherwise than its velocities say in any axes")
    if told or (found is not None and found.is_world):
        why = "as named" if told else f"not in {track.frame or 'those of the body'}: its positions change so"
        axes.said.append(f"{track.topic}: velocities taken in the axes of the world, {why}, and turned by its attitude")
        return True
    return False


def _words(frame: str) -> set[str]:
    return set(frame.rpartition("/")[2].lower().replace("-", "_").split("_"))


def _turn(track: Track, axes: _Axes) -> Array:
    """Signs from the body axes of a topic to SNAME: (6,)."""
    if axes.sure:
        axes.said.append(f"{track.topic}: taken as {axes.frame.upper()} axes, as told")
        return array(np.ones(6) if axes.frame == "fsd" else HALF_TURN)
    words = _words(track.frame)
    if words & WORLD_WORDS and track.kind in WRENCH_TYPES:
        raise UsageError(
            f"{track.topic}: is in frame {track.frame!r}, wanted a frame of the body such as base_link; "
            "if it is in body axes after all, say so with --frame flu or --frame fsd"
        )
    if words & DOWN_WORDS:
        axes.said.append(f"{track.topic}: frame {track.frame!r} taken as x forward, y starboard, z down")
        return array(np.ones(6))
    called = f"frame {track.frame!r}" if track.frame else "no frame is named, so it is"
    axes.said.append(f"{track.topic}: {called} taken as x forward, y left, z up (REP-103), and turned to z down")
    return array(HALF_TURN.copy())


def _times(velocity: Track, wrench: Track, said: list[str]) -> tuple[Array, Array]:
    """Times of both topics on one clock [ns]: of the stamps where both have them, else of receipt."""
    stamps = np.array(velocity.stamped), np.array(wrench.stamped)
    if all(len(one) and one.min() > 0 for one in stamps):
        (a, b), (c, d) = ((one.min(), one.max()) for one in stamps)
        if a < d and c < b:
            return stamps
        said.append("the stamps of both topics do not overlap: times of receipt are used")
    else:
        bare = velocity.topic if min(velocity.stamped, default=0) <= 0 else wrench.topic
        said.append(f"{bare} has no stamps: times of receipt are used for both topics")
    return np.array(velocity.received), np.array(wrench.received)
