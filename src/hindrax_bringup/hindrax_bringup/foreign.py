"""Bags that this stack has not made: which topics hold velocity and force, in which axes, and a record out of them.

Topics are found by their types. What cannot be known for sure is decided by the rules of REP-103 and REP-105, and said.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hindrax_bag.reader import BagMessage, messages
from hindrax_core.errors import UsageError
from hindrax_core.topics import ALLOCATION, MANEUVER, resolved
from hindrax_ident.arrays import Array, array
from hindrax_ident.readers import Recording

VELOCITY_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped",
)
WRENCH_TYPES = ("geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench")
FRAMES = ("flu", "fsd")
DOWN_WORDS = {"fsd", "frd", "ned", "sname"}
"""Words in the name of a body frame whose z axis points down."""
WORLD_WORDS = {"odom", "map", "world", "earth", "enu", "utm", "global"}
UNKNOWN_VARIANCE = 1e3
HALF_TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""From forward, left, up to forward, starboard, down, and back."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for: topics by name, or empty to find them by type; body axes, or empty to tell by the frames."""

    odometry: str = ""
    wrench: str = ""
    frame: str = ""


@dataclass(slots=True)
class Track:
    """Rows of one topic: times of the stamps (zero where there are none) and of receipt [ns], values, angles."""

    topic: str
    stamped: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    angles: list[tuple[float, float]] = field(default_factory=list)
    frame: str = ""


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


def read_bag(bag: Path, wanted: Wanted, topics: Mapping[str, str]) -> Recording:
    """Record of a bag of others. UsageError, with a list of what is there, where topics are missing or ambiguous."""
    velocity = _choose(bag, topics, VELOCITY_TYPES, wanted.odometry, ("velocity", "--odometry"))
    wrench = _choose(bag, topics, WRENCH_TYPES, wanted.wrench, ("force", "--wrench"))
    tracks = {velocity: Track(velocity), wrench: Track(wrench)}
    for message in messages(bag, {velocity, wrench}):
        _take(tracks[message.topic], message)
    return _recording(bag, tracks[velocity], tracks[wrench], wanted.frame)


def _choose(bag: Path, topics: Mapping[str, str], types: tuple[str, ...], named: str, words: tuple[str, str]) -> str:
    what, option = words
    fitting = [topic for topic, kind in topics.items() if kind in types]
    there = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(topics.items())) or "nothing"
    short = " or ".join(kind.partition("/msg/")[2] for kind in types)
    if named:
        if named in fitting:
            return named
        found = topics.get(named, "no such topic")
        raise UsageError(f"{option} {named}: found {found}, wanted {short}; {bag} holds {there}")
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise UsageError(
            f"{bag}: several topics may hold the {what}: {', '.join(sorted(fitting))}; name one with {option}"
        )
    raise UsageError(f"{bag}: no topic holds the {what} ({short}); it holds {there}")


def _take(track: Track, message: BagMessage) -> None:
    content = message.decoded()
    header = getattr(content, "header", None)
    track.stamped.append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec if header is not None else 0)
    track.received.append(message.received)
    if hasattr(content, "wrench") or hasattr(content, "force"):
        track.frame = header.frame_id if header is not None else ""
        track.rows.append(_wrench(getattr(content, "wrench", content)))
        return
    track.frame = getattr(content, "child_frame_id", "") or (
        "" if hasattr(content, "pose") or header is None else header.frame_id
    )
    track.rows.append(_twist(content.twist))
    if hasattr(content, "pose"):
        track.angles.append(_tilt(content.pose.pose.orientation))


def _wrench(content: Any) -> list[float]:
    f, m = content.force, content.torque
    return [float(value) for value in (f.x, f.y, f.z, m.x, m.y, m.z)]


def _twist(content: Any) -> list[float]:
    """Six velocities; NaN where the covariance says that one is not measured."""
    inner = getattr(content, "twist", content)
    a, b = inner.linear, inner.angular
    row = [float(value) for value in (a.x, a.y, a.z, b.x, b.y, b.z)]
    variances = [float(content.covariance[7 * i]) for i in range(6)] if hasattr(content, "covariance") else [0.0] * 6
    return [
        v if 0.0 <= variance < UNKNOWN_VARIANCE else float("nan") for v, variance in zip(row, variances, strict=True)
    ]


def _tilt(q: Any) -> tuple[float, float]:
    """Roll and pitch of a quaternion [rad], in the message's own axes."""
    size = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z
    if not size > 0.5:
        return float("nan"), float("nan")
    roll = np.arctan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x * q.x + q.y * q.y))
    return float(roll), float(np.arcsin(np.clip(2.0 * (q.w * q.y - q.z * q.x), -1.0, 1.0)))


# ---- axes and times


def _recording(bag: Path, velocity: Track, wrench: Track, frame: str) -> Recording:
    said: list[str] = []
    turn_v = _turn(velocity, frame, said)
    turn_w = turn_v if not wrench.frame and not frame else _turn(wrench, frame, said)
    if not wrench.frame and not frame:
        said.append(f"{wrench.topic} names no frame: taken to be in the axes of {velocity.topic}")
    said.append(f"{wrench.topic} is taken to be the wrench that the thrusters really made, about the center of mass")
    t_v, t_w = _times(velocity, wrench, said)
    origin = min(t_v.min(), t_w.min())
    v, w = np.argsort(t_v, kind="stable"), np.argsort(t_w, kind="stable")
    seconds_v, seconds_w = 1e-9 * (t_v[v] - origin).astype(float), 1e-9 * (t_w[w] - origin).astype(float)
    tilts = _tilts(velocity, turn_v)
    return Recording(
        source=str(bag),
        velocity_t=array(seconds_v),
        velocity=array((np.array(velocity.rows) * turn_v)[v]),
        wrench_t=array(seconds_w),
        wrench=array((np.array(wrench.rows) * turn_w)[w]),
        attitude_t=array(seconds_v) if len(tilts) else np.zeros(0),
        attitude=array(tilts[v]) if len(tilts) else np.zeros((0, 3)),
        origin_s=1e-9 * float(origin),
        assumptions=tuple(said),
    )


def _tilts(velocity: Track, turn: Array) -> Array:
    """Roll, pitch, depth (unknown) per velocity, in SNAME axes; (0, 3) where the topic has no pose."""
    if len(velocity.angles) != len(velocity.rows):
        return np.zeros((0, 3))
    both = np.array(velocity.angles) * np.array([1.0, float(turn[1])])
    return array(np.column_stack([both, np.full(len(both), np.nan)]))


def _turn(track: Track, frame: str, said: list[str]) -> Array:
    """Signs from the axes of a topic to SNAME: (6,)."""
    if frame:
        said.append(f"{track.topic}: taken as {frame.upper()} axes, as told")
        return array(np.ones(6) if frame == "fsd" else HALF_TURN)
    name = track.frame.rpartition("/")[2]
    words = set(name.lower().replace("-", "_").split("_"))
    if words & WORLD_WORDS:
        raise UsageError(
            f"{track.topic}: is in frame {track.frame!r}, wanted a frame of the body such as base_link; "
            "if it is in body axes after all, say so with --frame flu or --frame fsd"
        )
    if words & DOWN_WORDS:
        said.append(f"{track.topic}: frame {track.frame!r} taken as x forward, y starboard, z down")
        return array(np.ones(6))
    called = f"frame {track.frame!r}" if track.frame else "no frame is named, so it is"
    said.append(f"{track.topic}: {called} taken as x forward, y left, z up (REP-103), and turned to z down")
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
