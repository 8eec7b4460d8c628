"""What the pulses that were really applied achieve: the regressor of the identification."""

from __future__ import annotations

from collections.abc import Sequence

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import Vehicle

SERVO_US = (500.0, 2500.0)
"""What is outside is not a servo pulse at all but a sign of garbage."""

PULSE_FIELDS = {"mavros_msgs/msg/RCOut": "channels", "mavros_msgs/msg/OverrideRCIn": "channels"}
PULSE_FIELDS |= {
    f"std_msgs/msg/{kind}MultiArray": "data" for kind in ("UInt16", "Int16", "Int32", "Float32", "Float64")
}
"""Types of messages that may hold the pulse [us] of each output channel, and their field."""


def pulses_of_channels(vehicle: Vehicle, channels: Sequence[float]) -> list[float]:
    """Pulses of the thrusters [us] out of those of all output channels, where 0 means stop; ValueError if unfit."""
    wanted = max((thruster.channel + 1 for thruster in vehicle.thrusters), default=0)
    if len(channels) < wanted:
        raise ValueError(f"holds {len(channels)} channels, wanted {wanted} for {vehicle.name}")
    pulses = [float(channels[one.channel]) or float(vehicle.curves[one.curve].stop_us) for one in vehicle.thrusters]
    unfit = unfit_pulses(pulses, len(pulses))
    if unfit:
        raise ValueError(unfit)
    return pulses


def unfit_pulses(pulses_us: Sequence[float], thrusters: int) -> str:
    """Why pulses cannot be those of a vehicle with so many thrusters; empty when they can."""
    if len(pulses_us) != thrusters:
        return f"found {len(pulses_us)} pulses, wanted {thrusters}"
    low, high = SERVO_US
    if all(low <= pulse <= high for pulse in pulses_us):
        return ""
    wrong = next(pulse for pulse in pulses_us if not low <= pulse <= high)
    return f"found a pulse of {wrong:g} us, wanted {low:g} to {high:g} us"


class AppliedWrench:
    """Forces and wrench of pulses [us], in the order of the vehicle file, at one supply voltage."""

    def __init__(self, vehicle: Vehicle, supply_V: float | None = None) -> None:
        self._curves = thrust_curves(vehicle, supply_V)
        self._rows = tuple(tuple(float(entry) for entry in row) for row in effectiveness(vehicle))

    def forces_N(self, pulses_us: Sequence[float]) -> tuple[float, ...]:
        """Steady thrust of each thruster."""
        return tuple(curve.force(pulse) for curve, pulse in zip(self._curves, pulses_us, strict=True))

    def wrench(self, forces_N: Sequence[float]) -> Vec6:
        """Wrench about the center of mass [N, Nm], SNAME."""
        X, Y, Z, K, M, N = (sum(a * b for a, b in zip(row, forces_N, strict=True)) for row in self._rows)
        return (X, Y, Z, K, M, N)
