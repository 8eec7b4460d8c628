"""Values of single thrusters in the messages of any type: pulses, forces, or shares of full throttle.

`--wrench /esc/set:throttle=ratio` names the topic, the field that holds one number per output channel, and what the
numbers are. Nearly every vehicle has a message of its own for them, and none of these types can be known before. Where
each thruster has a topic of its own, as in simulators, `/rov/thrusters/*/thrust=N` names them all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hindrax_analysis.records.recording import forces_of_pulses
from hindrax_control.allocation.thrust_curve import PULSE_FIELDS, SERVO_US, ThrustCurve, thrust_curves
from hindrax_core.errors import UsageError
from hindrax_core.signals import Supply
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, Flags, array

PULSES, FORCES, THROTTLES = "us", "N", "ratio"
LEAST_V, MOST_V = 5.0, 60.0
"""Another voltage is that of an unconnected monitor."""
STEP_V = 0.1
"""Resolution of the voltage in the thrust curves."""
EACH = "*"
"""In a name for topics that have one number each: where they differ."""
FIELDS = {"geometry_msgs/msg/WrenchStamped": "wrench.force.x", "geometry_msgs/msg/Wrench": "force.x"}
"""Fields of such topics by type: a thruster pushes along the x of its own frame."""
UNITS = {
    PULSES: "pulses [us], converted to newtons by the curves of the vehicle file",
    FORCES: "forces of the thrusters [N], positive along their directions in the vehicle file",
    THROTTLES: "shares of the way from the stop to the last pulse of the curve (-1 to 1)",
}


@dataclass(frozen=True, slots=True)
class ThrusterValues:
    """A topic with one number per output channel: the path of the field (empty: by its type) and the unit, if named.

    `remedy` says how a unit is named where `--wrench` does not do it.
    """

    topic: str
    field: str = ""
    unit: str = ""
    remedy: str = ""

    @classmethod
    def named(cls, text: str) -> "ThrusterValues":
        """From `TOPIC`, `TOPIC:FIELD`, `TOPIC=UNIT` or `TOPIC:FIELD=UNIT`; UsageError for an unknown unit."""
        place, _, unit = text.partition("=")
        topic, _, field = place.partition(":")
        if "=" in text and unit not in UNITS:
            raise UsageError(f"--wrench {text}: found the unit {unit!r}, wanted one of {', '.join(UNITS)}")
        return cls(topic, field, unit)

    def path(self, kind: str) -> str:
        """Path of the field in a message of this type; empty where it is neither named nor known."""
        own = FIELDS.get(kind, "data") if EACH in self.topic else PULSE_FIELDS.get(kind, "")
        return self.field or own

    def row(self, kind: str, content: object) -> list[float]:
        """Numbers of a decoded message; UsageError when its field holds none."""
        found: Any = content
        for name in self.path(kind).split("."):
            if not hasattr(found, name):
                fields = ", ".join(getattr(found, "__slots__", ())) or "no fields"
                raise UsageError(f"{self.topic}: {kind} has no {name!r} at {self.path(kind)!r}; there are {fields}")
            found = getattr(found, name)
        try:
            return [float(found)] if EACH in self.topic else [float(value) for value in found]
        except (TypeError, ValueError) as error:
            wanted = f"{self.path(kind)} is {type(found).__name__}, wanted an array of numbers"
            several = "one number, of one topic per thruster, is named with a * for the number of the thruster"
            raise UsageError(f"{self.topic}: {wanted}; {several}") from error

    def unit_of(self, rows: Sequence[Sequence[float]]) -> str:
        """The named unit, or microseconds where all numbers are servo pulses; else UsageError: nothing is guessed."""
        low, high = SERVO_US
        values = [value for row in rows for value in row]
        if self.unit or all(low <= value <= high or value == 0.0 for value in values):
            return self.unit or PULSES
        name = f"--wrench {self.topic}{':' * bool(self.field)}{self.field}"
        ways = self.remedy or f"{name}={FORCES} for newtons, {name}={THROTTLES} for shares of full throttle"
        found = f"holds {min(values):g} to {max(values):g}, no pulses in microseconds"
        raise UsageError(f"{self.topic}: {found}; name their unit: {ways}")


def is_connected(measured_V: Array) -> Flags:
    """Which voltages (n,) are those of a battery that is wired: (n,)."""
    return (measured_V >= LEAST_V) & (measured_V <= MOST_V)


class Supplies(NamedTuple):
    """Supply voltages [V] of n rows in steps of STEP_V, how they are known, and a note on where they are from."""

    volts: list[float]
    known: Supply
    note: str


def supplies_at(t: Array, measured_t: Array, measured_V: Array, vehicle: Vehicle) -> Supplies:
    """Supply of the thrusters at each time.

    Parameters
    ----------
    t : (n,) [s]
        Of the pulses.
    measured_t, measured_V : (m,) [s], (m,) [V]
        Of a battery, none where it is not recorded; what no battery has is left out, such as 0 where none is wired.
    vehicle
        Its supply is assumed where none is measured.

    Returns
    -------
    Supplies
        n of them.
    """
    connected = is_connected(measured_V)
    if not connected.any():
        note = f"no supply voltage is logged: {vehicle.supply_V:g} V is assumed"
        return Supplies([vehicle.supply_V] * len(t), Supply.ASSUMED, note)
    logged = measured_V[connected]
    volts = STEP_V * np.round(np.interp(t, measured_t[connected], logged) / STEP_V)
    note = f"thrust follows the curves at the logged {logged.min():.1f} to {logged.max():.1f} V"
    return Supplies(volts.tolist(), Supply.MEASURED, note)


def forces_of_thrusters(
    values: ThrusterValues, rows: Sequence[Sequence[float]], vehicle: Vehicle, supplies_V: Sequence[float] = ()
) -> Array:
    """Forces of the thrusters of numbers per output channel.

    Parameters
    ----------
    values
        What the numbers are: pulses, newtons, shares.
    rows : (n, channels)
        Numbers. UsageError for those that cannot be of the vehicle.
    vehicle
        With its thrusters.
    supplies_V : (n,) [V]
        Supply at each row; empty: of the vehicle file. Forces do not need it.

    Returns
    -------
    Array
        (n, k) [N] along the directions of the thrusters.
    """
    unit = values.unit_of(rows)
    if unit == FORCES:
        return array(np.array([_of_channels(values, row, vehicle) for row in rows]))
    if unit == THROTTLES:
        rows = _pulses(values, rows, vehicle)
    return forces_of_pulses(values.topic, rows, supplies_V or [vehicle.supply_V] * len(rows), vehicle)


def _of_channels(values: ThrusterValues, row: Sequence[float], vehicle: Vehicle) -> list[float]:
    """Numbers in the order of the thrusters out of those of the channels."""
    wanted = max((one.channel + 1 for one in vehicle.thrusters), default=0)
    if len(row) < wanted:
        raise UsageError(f"{values.topic}: holds {len(row)} channels, wanted {wanted} for {vehicle.name}")
    return [row[one.channel] for one in vehicle.thrusters]


def _pulses(values: ThrusterValues, rows: Sequence[Sequence[float]], vehicle: Vehicle) -> list[list[float]]:
    """Pulses per output channel [us] of shares of full throttle."""
    largest = max((abs(value) for row in rows for value in row), default=0.0)
    if largest > 1.0:
        raise UsageError(f"{values.topic}: holds {largest:g}, wanted shares of full throttle from -1 to 1")
    travels = {
        one.channel: _travel(curve) for one, curve in zip(vehicle.thrusters, thrust_curves(vehicle), strict=True)
    }
    stops = {one.channel: vehicle.curves[one.curve].stop_us for one in vehicle.thrusters}
    return [
        [stops[channel] + travels[channel](share) if channel in stops else 0.0 for channel, share in enumerate(row)]
        for row in rows
    ]


def _travel(curve: ThrustCurve) -> Callable[[float], float]:
    """Way from the stop [us] of a share of full throttle: positive is a longer pulse, as ESCs are driven."""
    ends = sorted(curve.pulse(force) - curve.stop_us for force in curve.range_N)
    return lambda share: share * ends[1] if share >= 0.0 else -share * ends[0]
