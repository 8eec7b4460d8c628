"""Thrust curves: force from pulse, pulse from force, both exact, checked when they are made; wrench of applied pulses.

COB-2023-1394 eq. 1: F = c4 P^3 + c3 P^2 + c2 P + c1 with one cubic per direction; or a measured table. Around
the stop pulse lies the dead band of the speed controller; the cubics do not pass through zero at its edges, so the
smallest forces cannot be had.
"""

import math
from collections.abc import Sequence
from operator import mul

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec6, vec6
from hindrax_core.thrust.curves import Curve, Running, problems_of, running
from hindrax_core.vehicle import Vehicle

HYSTERESIS = 0.1
"""Half width of the hysteresis at the dead band, as a fraction of the smallest running force."""
SERVO_US = (500.0, 2500.0)
"""A value outside is no servo pulse but garbage."""
PULSE_FIELDS = {"mavros_msgs/msg/RCOut": "channels", "mavros_msgs/msg/OverrideRCIn": "channels"}
PULSE_FIELDS |= {
    f"std_msgs/msg/{kind}MultiArray": "data" for kind in ("UInt16", "Int16", "Int32", "Float32", "Float64")
}
"""Types of messages that may hold the pulse [us] of each output channel, and their field."""
WRAPS = {"mavros_msgs/msg/RCOut": 2**32 * 1000}
"""Time [ns] after which their stamps begin again: an autopilot counts that of its outputs in microseconds of 32 bits
(common.xml: SERVO_OUTPUT_RAW.time_usec), and MAVROS adds a constant (rc_io.cpp)."""


class ThrustCurve:
    """One thruster's static curve at one supply voltage.

    UsageError with every reason when the curve cannot be a thrust curve. Plain floats in and out: newtons along the
    thrust axis, microseconds. `mirrored` is for a thruster that turns the other way round: its force at a pulse is
    that of the curve at the pulse reflected about the stop.

    With a margin the dead band is wider [us]. `range_N` holds the largest force in each direction, `gap_N` the smallest
    running one.
    """

    def __init__(
        self,
        curve: Curve,
        supply_V: float | None = None,
        *,
        mirrored: bool = False,
        name: str = "",
        margin_us: float = 0.0,
    ) -> None:
        label = f"thrust curve {name}".rstrip()
        problems = problems_of(curve)
        if problems:
            raise UsageError(f"{label}: {'; '.join(problems)}")
        self.supply_V = curve.supply_V if supply_V is None else supply_V
        if not (math.isfinite(self.supply_V) and self.supply_V > 0.0):
            raise UsageError(f"{label}: found a supply of {self.supply_V:g} V, wanted more than zero")
        self.stop_us = curve.stop_us
        now = running(curve, self.supply_V, margin_us)
        back, forth = now.negative, now.positive
        if mirrored:
            back, forth = back.reflected(self.stop_us), forth.reflected(self.stop_us)
            low_us, high_us = now.dead_us
            now = Running(forth, back, (2.0 * self.stop_us - high_us, 2.0 * self.stop_us - low_us))
        self._running = now
        self._back, self._forth = back.inverse(), forth.inverse()
        weak_back, strong_back = sorted((back.force_N(back.from_us), back.force_N(back.to_us)), reverse=True)
        weak_forth, strong_forth = sorted((forth.force_N(forth.from_us), forth.force_N(forth.to_us)))
        self.range_N, self.gap_N = (strong_back, strong_forth), (weak_back, weak_forth)
        self._low_N, self._high_N = self.gap_N

    def force(self, pulse_us: float) -> float:
        """Steady thrust [N] of a pulse [us]: zero within the dead band, that of the end beyond an end."""
        return 0.0 if pulse_us == self.stop_us else self._running.force_N(pulse_us)

    def pulse(self, force_N: float, previous_us: float = 0.0) -> float:
        """Pulse that gives a force, clipped to the range.

        A force between zero and the smallest running force cannot be had: the nearer of both is taken, with
        hysteresis, so that a force at the middle does not make the thruster chatter.

        Parameters
        ----------
        force_N : [N]
            In the thruster's own direction; one that is not a number gives the stop pulse.
        previous_us : [us]
            Pulse sent before; 0: unknown. A thruster that runs keeps running a little longer; one that stands starts a
            little later.

        Returns
        -------
        float
            [us], not yet rounded.
        """
        if force_N >= self._high_N:
            return self._forth(force_N)
        return self._back(force_N) if force_N <= self._low_N else self._near_stop(force_N, previous_us)

    def _near_stop(self, force_N: float, previous_us: float) -> float:
        forth = force_N >= 0.0
        weakest_N = self._high_N if forth else self._low_N
        threshold = 0.5
        if previous_us:
            running_N = self.force(previous_us)
            runs = running_N > 0.0 if forth else running_N < 0.0
            threshold += -HYSTERESIS if runs else HYSTERESIS
        if abs(force_N) > threshold * abs(weakest_N):
            return self._forth(weakest_N) if forth else self._back(weakest_N)
        return self.stop_us


def thrust_curves(vehicle: Vehicle, supply_V: float | None = None, margin_us: float = 0.0) -> tuple[ThrustCurve, ...]:
    """Return the curve of each thruster in the order of the vehicle file.

    Parameters
    ----------
    vehicle
        Thrusters and curves.
    supply_V : [V]
        Supply voltage; None: the nominal one of the vehicle.
    margin_us : [us]
        Widens the dead bands.

    Returns
    -------
    tuple[ThrustCurve, ...]
        Mirrored for thrusters that turn the other way.
    """
    volts = vehicle.supply_V if supply_V is None else supply_V
    return tuple(
        ThrustCurve(
            vehicle.curves[one.curve],
            volts,
            mirrored=one.reversed,
            name=f"curves.{one.curve} ({one.name})",
            margin_us=margin_us,
        )
        for one in vehicle.thrusters
    )


def pulses_of_channels(vehicle: Vehicle, channels: Sequence[float]) -> list[float]:
    """Pulses of the thrusters out of those of all output channels.

    Parameters
    ----------
    vehicle
        Says which channel drives which thruster.
    channels : (c,) [us]
        Pulses by channel; 0 means stop.

    Returns
    -------
    list[float]
        (n,) [us] in the order of the vehicle file.

    Raises
    ------
    ValueError
        For too few channels, and for a pulse that no servo output has.
    """
    wanted = max((thruster.channel + 1 for thruster in vehicle.thrusters), default=0)
    if len(channels) < wanted:
        raise ValueError(f"holds {len(channels)} channels, wanted {wanted} for {vehicle.name}")
    pulses = [float(channels[one.channel]) or float(vehicle.curves[one.curve].stop_us) for one in vehicle.thrusters]
    check_pulses(pulses, len(pulses))
    return pulses


def check_pulses(pulses_us: Sequence[float], thrusters: int) -> None:
    """Check that pulses are those of a vehicle with so many thrusters.

    Parameters
    ----------
    pulses_us : (n,) [us]
        One per thruster.
    thrusters
        Number wanted.

    Raises
    ------
    ValueError
        For another number, or a pulse that no servo output has.
    """
    if len(pulses_us) != thrusters:
        raise ValueError(f"found {len(pulses_us)} pulses, wanted {thrusters}")
    low, high = SERVO_US
    for pulse in pulses_us:
        if not low <= pulse <= high:
            raise ValueError(f"found a pulse of {pulse:g} us, wanted {low:g} to {high:g} us")


class AppliedWrench:
    """Forces and wrench of pulses [us], in the order of the vehicle file, at one supply voltage."""

    def __init__(self, vehicle: Vehicle, supply_V: float | None = None) -> None:
        self._curves = thrust_curves(vehicle, supply_V)
        self._rows = tuple(tuple(float(entry) for entry in row) for row in effectiveness(vehicle))

    def forces_N(self, pulses_us: Sequence[float]) -> tuple[float, ...]:
        """Steady thrust of each thruster."""
        return tuple(curve.force(pulse) for curve, pulse in zip(self._curves, pulses_us, strict=True))

    def wrench(self, forces_N: Sequence[float]) -> Vec6:
        """Wrench about the center of mass [N, N m], SNAME."""
        return vec6(sum(map(mul, row, forces_N)) for row in self._rows)
