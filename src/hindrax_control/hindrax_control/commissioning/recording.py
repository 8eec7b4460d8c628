"""What a commissioning records: raw readings of the sensors and forces of the thrusters, by time, in sensor axes.

Nothing is turned by a mount of the vehicle file or fused: both are what is to be proven.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix
from hindrax_core.events import Stamp, Stamped, to_s
from hindrax_core.readings import Battery, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading

Row = tuple[float, ...]


@dataclass
class Series:
    """Samples of one quantity: time [s] and values."""

    source: str = ""
    times_s: list[float] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    _arrays: tuple[Matrix, Matrix] = field(default_factory=lambda: (np.zeros(0), np.zeros((0, 6))), repr=False)

    def add(self, source: str, stamp: Stamp, row: Row) -> None:
        """Append a sample; a second sensor of the quantity is not used.

        Parameters
        ----------
        source
            Name of the sensor.
        stamp
            Of the sample.
        row
            Its numbers.
        """
        self.source = self.source or source
        if source == self.source:
            self.times_s.append(to_s(stamp))
            self.rows.append(row)

    def between(self, begin_s: float, end_s: float) -> tuple[Matrix, Matrix]:
        """Times (n,) and values (n, k) within an interval, in the order of time."""
        if len(self._arrays[0]) != len(self.times_s):  # many ask between two samples
            self._arrays = np.array(self.times_s), np.array(self.rows)
        times, rows = self._arrays
        inside = np.flatnonzero((times >= begin_s) & (times < end_s)) if len(times) else np.zeros(0, int)
        order = inside[np.argsort(times[inside], kind="stable")] if len(inside) else inside
        return (times[order], rows[order]) if len(order) else (np.zeros(0), np.zeros((0, 6)))


@dataclass
class Recording:
    """All that the verdicts are made of."""

    inertial: Series = field(default_factory=Series)
    """Specific force [m/s^2] and rate [rad/s]."""
    magnetic: dict[str, Series] = field(default_factory=lambda: defaultdict(Series))
    """By sensor: field [T]."""
    velocity: dict[str, Series] = field(default_factory=lambda: defaultdict(Series))
    """By sensor: velocity over ground [m/s]; NaN without lock."""
    pressure: dict[str, Series] = field(default_factory=lambda: defaultdict(Series))
    """By sensor: absolute pressure [Pa]."""
    echo: dict[str, Series] = field(default_factory=lambda: defaultdict(Series))
    """By sensor: range [m]."""
    battery: Series = field(default_factory=Series)
    """Voltage [V] and current [A]."""
    forces: Series = field(default_factory=Series)
    """What the applied pulses give by the curves of the vehicle file, by thruster, from this time on [N]."""

    def on_reading(self, source: str, stamped: Stamped[Reading]) -> None:
        """Keep a reading of a sensor."""
        stamp = stamped.stamp
        match stamped.reading:
            case Inertial() as one:
                self.inertial.add(source, stamp, (*one.specific_force_mps2, *one.rate_radps))
            case Magnetic() as one:
                self.magnetic[source].add(source, stamp, one.field_T)
            case BottomVelocity() as one:
                self.velocity[source].add(source, stamp, one.velocity_mps or (math.nan,) * 3)
            case Pressure() as one:
                self.pressure[source].add(source, stamp, (one.pressure_Pa,))
            case Echo() as one:
                self.echo[source].add(source, stamp, (one.range_m,))
            case Battery() as one:
                self.battery.add(source, stamp, (one.voltage_V, one.current_A))
            case _:
                pass

    @property
    def first_pressure(self) -> Series:
        """Pressure of the sensor that sent first, by which the depth of what else is judged is taken."""
        return next(iter(self.pressure.values()), Series())

    def on_forces(self, stamp: Stamp, forces_N: Sequence[float]) -> None:
        """Keep what the thrusters give from this stamp on."""
        if forces_N:
            self.forces.add("thrusters", stamp, tuple(forces_N))
