"""Topics that the identifier reads: those of this stack by the bytes of their messages, and those of another stack."""

import math

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry

from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.messages.contents import Read
from hindrax_core.rotation import FLU, FSD, foreign_frame, unprefixed
from hindrax_core.signals import NAN, Attitude, IdentEvent, Thrust, Velocity
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.topics import Quality, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_ident.records.feed import Measurement
from hindrax_ident.records.measurements import measurements
from hindrax_ros.messages.convert import (
    half_turn,
    odometry_from_msg,
    stamp_from_msg,
    wrench_from_msg,
)
from hindrax_ros.messages.serialization import contents_reader


def readers(vehicle: Vehicle) -> dict[Topic, Read[Measurement]]:
    """Topics that the identification of a vehicle reads, and the reader of each; ValueError for other bytes."""
    return {topic: contents_reader(topic.type, contents) for topic, contents in measurements(vehicle).items()}


# ---- of another stack

ANY = Quality(reliable=False, depth=5000)
"""Takes reliable publishers too; keeps what comes while `ident/assess` computes."""
ANY_ODOMETRY = Topic("odometry", "nav_msgs/msg/Odometry", ANY, 0, "velocities and attitude of any vehicle")
ANY_WRENCH = Topic("wrench", "geometry_msgs/msg/WrenchStamped", ANY, 0, "wrench that its thrusters achieve")
LARGEST_LEAD_S = 60.0
"""A stamp farther ahead of the clock would make all that follow it late."""
LARGEST_VARIANCE = 1e3
"""Variances from here on, or below zero, mean that a velocity is not measured."""


def velocities_from_odometry(message: Odometry, now: Stamp, prefix: str = "") -> tuple[Stamped[IdentEvent], ...]:
    """Attitude and velocities of a REP-105 odometry; without a stamp, of `now`.

    ValueError for other frames, and where no velocity is measured.
    """
    found = odometry_from_msg(message, prefix)
    stamp = _sensible(found.stamp, now)
    variances, state = message.twist.covariance[::7], found.reading
    pairs = zip((*state.velocity_mps, *state.rate_radps), variances, strict=True)
    u, v, w, p, q, r = (value if 0.0 <= variance < LARGEST_VARIANCE else NAN for value, variance in pairs)
    roll, pitch, _ = state.attitude_rad
    nu = (u, v, w, p, q, r)
    if not any(map(math.isfinite, nu)):
        wanted = f"one of a variance from 0 (unknown) to {LARGEST_VARIANCE:g}"
        raise ValueError(Refusal(Reason.NOT_FINITE, f"found no velocity that is measured, wanted {wanted}"))
    return Stamped(stamp, Attitude((roll, pitch, NAN))), Stamped(stamp, Velocity(nu, "odometry"))


def thrust_from_wrench(message: WrenchStamped, now: Stamp, prefix: str = "") -> tuple[Stamped[IdentEvent], ...]:
    """Thrust in `base_link` (also where no frame is named) or `base_link_fsd`. ValueError for other frames."""
    frame, wrench = unprefixed(message.header.frame_id), wrench_from_msg(message)
    if foreign := foreign_frame(message.header.frame_id, prefix):
        raise ValueError(foreign)
    if frame not in (FSD, FLU, ""):
        raise ValueError(Refusal(Reason.FRAME, f"found frame {frame[:40]!r}, wanted {FLU} or {FSD}"))
    if not all(map(math.isfinite, wrench)):
        raise ValueError(Refusal(Reason.NOT_FINITE, "found a wrench that is not finite, wanted numbers"))
    if frame != FSD:
        wrench = (*half_turn(wrench[:3]), *half_turn(wrench[3:]))
    return (Stamped(_sensible(stamp_from_msg(message.header.stamp), now), Thrust(wrench)),)


def _sensible(stamp: Stamp, now: Stamp) -> Stamp:
    """Stamp of a measurement, `now` where it has none; ValueError for one from the future."""
    lead_s = seconds_between(now, stamp)
    if now and lead_s > LARGEST_LEAD_S:
        found = f"found a stamp {lead_s:.0f} s ahead of the clock, wanted at most {LARGEST_LEAD_S:g} s"
        raise ValueError(Refusal(Reason.CLOCK, found))
    return stamp or now
