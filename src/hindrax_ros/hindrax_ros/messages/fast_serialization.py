"""The topics of every control cycle as CDR bytes, without message objects; those of the sensors see `reading_fields`.

Numbers are written into the bytes of the previous message (see `serialization`); ADR 25 has what this saves. Each
writer is tested against a message object that is filled field by field, each reader against it or what was written.
"""

import math
import struct
from collections.abc import Callable, Sequence

from nav_msgs.msg import Odometry

from hindrax_core.events import NS_PER_S, Stamp, Stamped
from hindrax_core.messages import contents
from hindrax_core.messages.cdr import ENCAPSULATION, LITTLE_ENDIAN
from hindrax_core.messages.contents import STAMP, Read, parts
from hindrax_core.readings import Vec6
from hindrax_core.rotation import FLU, FSD, xyzw_from_sname
from hindrax_core.signals import Allocation, AppliedOutput, Command, Navigation, Thrust
from hindrax_core.topics import ALLOCATION, NAVIGATION, THRUSTER_COMMAND, THRUSTER_STATE
from hindrax_msgs.msg import AllocationStatus, NavigationStatus, ThrusterCommand, ThrusterState
from hindrax_ros.messages import convert
from hindrax_ros.messages.serialization import CdrWriter, contents_reader, fields_reader

_ZERO6, _ZERO28 = (0.0,) * 6, (0.0,) * 28


def navigation_writer(prefix: str = "") -> Callable[[Stamped[Navigation]], bytes]:
    """Make a writer of NavigationStatus: full navigation state, SNAME."""
    writer = CdrWriter(*STAMP, *contents.NAVIGATION.paths, "ages")

    def write(stamped: Stamped[Navigation]) -> bytes:
        state, ages = stamped.reading, stamped.reading.ages_s
        sources = tuple(ages)
        if writer.key != sources:
            writer.learn(
                sources,
                NavigationStatus(header=convert.header(0, prefix + FSD), sources=sources, ages=list(ages.values())),
            )
        u, v, w = state.velocity_mps
        roll, pitch, heading = state.attitude_rad
        depth_age, altitude_age = state.depth_age_s, state.altitude_age_s
        return writer.write(
            (
                *divmod(stamped.stamp, NS_PER_S),
                *(state.depth_m, depth_age, math.isfinite(state.depth_m)),
                *(state.altitude_m, altitude_age, math.isfinite(state.altitude_m)),
                *(w, min(depth_age, altitude_age), math.isfinite(w)),
                *(heading, roll, pitch, u, v),
                *state.velocity_sigma_mps,
                *state.rate_radps,
                *state.position_m,
                state.dvl_locked,
                *ages.values(),
            )
        )

    return write


def odometry_writer(prefix: str = "") -> Callable[[Stamped[Navigation]], bytes]:
    """Make a writer of Odometry: pose in `odom` (east, north, up from the start), twist in `base_link` (REP-105).

    Parameters
    ----------
    prefix
        Of both frames.

    Returns
    -------
    Callable[[Stamped[Navigation]], bytes]
        Writes CDR bytes. Variances are those of the velocities, and of east and north since the position was last
        known; NaN where unknown.
    """
    pose = (*parts("pose.pose.position"), *parts("pose.pose.orientation", "xyzw"), "pose.covariance")
    twist = (*parts("twist.twist.linear"), *parts("twist.twist.angular"), "twist.covariance")
    writer = CdrWriter(*STAMP, *pose, *twist)
    writer.learn(None, Odometry(header=convert.header(0, f"{prefix}odom"), child_frame_id=prefix + FLU))

    def write(stamped: Stamped[Navigation]) -> bytes:
        state = stamped.reading
        north, east = state.position_m
        variance = state.position_sigma_m**2
        covariance = [0.0] * 36
        for axis, sigma in enumerate(state.velocity_sigma_mps):
            covariance[7 * axis] = sigma * sigma
        return writer.write(
            (
                *divmod(stamped.stamp, NS_PER_S),
                *(east, north, -state.depth_m),
                *xyzw_from_sname(*state.attitude_rad),
                *(variance, *_ZERO6, variance, *_ZERO28),
                *convert.half_turn(state.velocity_mps),
                *convert.half_turn(state.rate_radps),
                *covariance,
            )
        )

    return write


def wrench_writer(prefix: str = "") -> Callable[[Stamp, Vec6], bytes]:
    """Make a writer: `convert.wrench_to_msg`."""
    writer = CdrWriter(*STAMP, *parts("wrench.force"), *parts("wrench.torque"))
    writer.learn(None, convert.wrench_to_msg(Stamp(0), _ZERO6, prefix))
    return lambda stamp, wrench: writer.write((*divmod(stamp, NS_PER_S), *wrench))


def command_writer(thrusters: int, prefix: str = "") -> Callable[[Stamp, int, Sequence[float]], bytes]:
    """Make a writer of ThrusterCommand: stamp, sequence, pulses [us]."""
    writer = CdrWriter(*STAMP, "sequence", "pulses")
    writer.learn(None, ThrusterCommand(header=convert.header(0, prefix + FSD), pulses=[0.0] * thrusters))
    return lambda stamp, sequence, pulses: writer.write((*divmod(stamp, NS_PER_S), sequence, *pulses))


def applied_writer(output: str) -> Callable[[AppliedOutput], bytes]:
    """Make a writer of ThrusterState: its numbers, its state and its reason."""
    writer = CdrWriter(*STAMP, "armed", "pulses", "sequence", "armings")

    def write(applied: AppliedOutput) -> bytes:
        shape = (applied.phase, applied.reason, len(applied.pulses_us))
        if writer.key != shape:
            state, reason = str(applied.phase), applied.reason
            writer.learn(shape, ThrusterState(pulses=applied.pulses_us, state=state, reason=reason, output=output))
        return writer.write(
            (*divmod(applied.stamp, NS_PER_S), applied.armed, *applied.pulses_us, applied.sequence, applied.armings),
        )

    return write


def allocation_writer(
    thrusters: Sequence[str], nominal_V: float, prefix: str = ""
) -> Callable[[AppliedOutput, Allocation, float | None], bytes]:
    """Make a writer of AllocationStatus.

    Parameters
    ----------
    thrusters
        Their names.
    nominal_V : [V]
        Supply where none is measured.
    prefix
        Of the frame.

    Returns
    -------
    Callable[[AppliedOutput, Allocation, float | None], bytes]
        Writes CDR bytes of what applied pulses achieve, by the measured supply; None: the nominal one.
    """
    numbers = ("sequence", "wanted", "achieved", "shortfall", "forces", "pulses", "saturated")
    writer = CdrWriter(*STAMP, *numbers, "supply_voltage", "supply_measured")

    def write(applied: AppliedOutput, found: Allocation, supply_V: float | None) -> bytes:
        texts = (found.disabled, found.lost_axes, found.refused)
        if writer.key != texts:
            example = AllocationStatus(
                header=convert.header(0, prefix + FSD),
                thrusters=thrusters,
                forces=found.forces_N,
                pulses=applied.pulses_us,
                saturated=found.saturated,
                disabled=found.disabled,
                lost_axes=found.lost_axes,
                refused=found.refused,
            )
            writer.learn(texts, example)
        return writer.write(
            (
                *divmod(applied.stamp, NS_PER_S),
                applied.sequence,
                *(*found.wanted, *found.achieved, *found.shortfall),
                *(*found.forces_N, *applied.pulses_us, *found.saturated),
                nominal_V if supply_V is None else supply_V,
                supply_V is not None,
            )
        )

    return write


def raw_frames_bytes(
    stamp: Stamp,
    source: str,
    *,
    stamps: Sequence[int],
    directions: bytes | bytearray,
    lengths: Sequence[int],
    data: bytes | bytearray,
) -> bytes:
    """Bytes of RawFrames, whose batches all differ in shape.

    A C struct is aligned as CDR is: each number at a multiple of its size.

    Parameters
    ----------
    stamp
        Of the message.
    source
        Name of the sensor or output.
    stamps, directions, lengths, data
        As in the definition of the message, one entry for each frame.

    Returns
    -------
    bytes
        CDR.
    """
    name, count = source.encode() + b"\0", len(stamps)
    form = f"iII1sI{len(name)}sI{count}QI{count}sI{count}II{len(data)}s"
    head = (*divmod(stamp, NS_PER_S), 1, b"\0", len(name), name)
    packed = struct.pack(form, *head, count, *stamps, count, directions, count, *lengths, len(data), data)
    return LITTLE_ENDIAN.ljust(ENCAPSULATION, b"\0") + packed


_command = fields_reader(THRUSTER_COMMAND.type, *STAMP, "sequence", "pulses")
_lamps = fields_reader(THRUSTER_COMMAND.type, "lights")
_applied = fields_reader(THRUSTER_STATE.type, *STAMP, "armed", "pulses", "sequence", "armings")
navigation_from_bytes: Read[Navigation] = contents_reader(NAVIGATION.type, contents.NAVIGATION)
thrust_from_bytes: Read[Thrust] = contents_reader(ALLOCATION.type, contents.THRUST)


def command_from_bytes(data: bytes) -> Command:
    """Read the numbers of a ThrusterCommand. ValueError for bytes that are none."""
    s, ns, sequence, *pulses = _command(data)
    return Command(tuple(pulses), _lamps(data), Stamp(s * NS_PER_S + ns), sequence)


def applied_from_bytes(data: bytes) -> AppliedOutput:
    """Read the numbers of a ThrusterState."""
    s, ns, armed, *pulses, sequence, armings = _applied(data)
    return AppliedOutput(Stamp(s * NS_PER_S + ns), armed, tuple(pulses), sequence, armings)
