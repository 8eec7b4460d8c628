"""Columns of single thrusters in a CSV file: pulses, forces or shares of full throttle, one column per output channel.

`pwm1 ... pwm8`, `servo1_raw`, `C1` (a DataFlash log as CSV), `channels[0]`, `thrust_3 [kgf]`, `throttle_2`: a word and
a number. Numbers begin at 0 where a 0 is among them, else at 1, and are those of the output channels. They are used
where no column is a force of the vehicle, at the voltage of a column such as `supply_V`, else at the one of the vehicle
file.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hindrax_analysis.records.csv.columns import UNITS, plain_unit
from hindrax_analysis.records.thruster_values import FORCES, PULSES, THROTTLES, ThrusterValues, forces_of_thrusters
from hindrax_control.allocation.thrust_curve import SERVO_US
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, Flags, array

OUTPUTS = "pwm1 ..."
MEANING = "pulses of the outputs [us], instead of forces; also thrust1_N, throttle1; with supply_V, where measured"
SPEEDS, FORCES_BY_NAME = "rpm", "N by name"
"""Units that no wrench follows from at once: a speed of rotation, and what is called a force without a unit."""
_WORDS = {
    **dict.fromkeys(("pwm", "pulse", "pulses", "servo", "rcou", "rc_out", "channel", "channels", "ch", "c"), ""),
    **dict.fromkeys(("thruster", "motor", "esc", "output", "outputs", "t", "u", "cmd", "command", "input"), ""),
    **dict.fromkeys(("thrust", "force"), FORCES_BY_NAME),
    "throttle": THROTTLES,
    "rpm": SPEEDS,
}
"""Words in use before the number, and the unit where none is named; empty: by the size of the numbers."""
_UNITS = {
    "us": (PULSES, 1.0),
    "pwm": (PULSES, 1.0),
    **{name: (FORCES, factor) for name, factor in UNITS["X"].items()},
    "ratio": (THROTTLES, 1.0),
    "%": (THROTTLES, 0.01),
    "rpm": (SPEEDS, 1.0),
}
_OUTPUT = re.compile(
    r"(?:.*[^0-9a-z])?"  # path of a message, as PlotJuggler writes it
    rf"(?P<word>{'|'.join(sorted(_WORDS, key=len, reverse=True))})"
    r"[\s._/\[-]*(?P<number>\d{1,2})\]?"
    r"(?:[\s._-]*(?:raw|pwm|(?P<force>force|thrust)|(?P<throttle>throttle)))?"
    r"(?:[\s._-]*[\[(]?(?P<unit>[^\W\d_]+|%)[\])]?)?"
)
_SUPPLY = re.compile(
    r"(?:.*[^0-9a-z])?(?:supply|voltage|volt|vbat|batt?ery|batt?)(?:[\s._-]*voltage)?[\s._-]*[\[(]?v?[\])]?"
)
REMEDY = "thruster1_N in the header line for newtons, thruster1_ratio for shares of full throttle"


class OutputColumn(NamedTuple):
    """Column of an output channel: its number in the file, unit (empty: not named), and factor to that unit."""

    number: int
    unit: str
    factor: float

    def with_unit(self, named: str) -> "OutputColumn":
        """The column with a unit that stands elsewhere; the same for an unknown one."""
        unit, factor = _UNITS.get(plain_unit(named), (self.unit, self.factor))
        return OutputColumn(self.number, unit, factor)


def output_of(header: str) -> OutputColumn | None:
    """Output channel of a column by its header; None for another column, and for an unknown unit."""
    found = _OUTPUT.fullmatch(header.strip().lower())
    if not found:
        return None
    after = FORCES_BY_NAME if found["force"] else THROTTLES if found["throttle"] else _WORDS[found["word"]]
    column = OutputColumn(int(found["number"]), after, 1.0)
    if not found["unit"]:
        return column
    return column.with_unit(found["unit"]) if plain_unit(found["unit"]) in _UNITS else None


def is_supply(header: str) -> bool:
    """Whether a column is a supply voltage [V], by its header."""
    return bool(_SUPPLY.fullmatch(header.strip().lower()))


@dataclass(frozen=True, slots=True)
class Outputs:
    """Numbers per output channel of a file, (n,) each by number, in a unit (empty: by size), and supplies [V]."""

    source: str
    unit: str
    by_number: Mapping[int, Array]
    supply_V: Array
    """(n,); NaN: not measured."""

    @property
    def is_supply_measured(self) -> bool:
        """Whether the forces are those at a measured voltage."""
        return self.unit != FORCES and bool(np.isfinite(self.supply_V).any())

    @property
    def _first(self) -> int:
        return 0 if 0 in self.by_number else 1

    def required(self, vehicle: Vehicle | None) -> Vehicle:
        """The vehicle, which makes forces of these numbers; UsageError where it cannot, or not of these."""
        if self.unit == SPEEDS:
            sheet = "write thruster1_N = k n |n| of each speed n, with k of the thruster's data sheet"
            raise UsageError(f"{self.source}: holds speeds of the thrusters in rpm, wanted forces or pulses; {sheet}")
        if vehicle is None or not vehicle.thrusters:
            remedy = "name a vehicle file with thrusters and curves by --vehicle"
            raise UsageError(f"{self.source}: holds values of single thrusters, wanted a wrench; {remedy}")
        lacks = sorted({one.channel + self._first for one in vehicle.thrusters} - set(self.by_number))
        if lacks:
            has, wants = (", ".join(map(str, sorted(some))) for some in (self.by_number, lacks))
            raise UsageError(f"{self.source}: has columns of the outputs {has}; {vehicle.name} also needs {wants}")
        return vehicle

    def forces(self, vehicle: Vehicle) -> Array:
        """Forces of the thrusters at each row.

        Parameters
        ----------
        vehicle
            Its channels and curves (`required`).

        Returns
        -------
        Array
            (n, k) [N] along the directions of the thrusters; NaN where an output has no number.

        Raises
        ------
        UsageError
            For numbers that are of no output.
        """
        # Outputs without a column are of no thruster.
        nothing = np.zeros(len(self.supply_V))
        numbers = range(self._first, max(self.by_number) + 1)
        table = np.column_stack([self.by_number.get(number, nothing) for number in numbers])
        known: Flags = np.logical_and.reduce(np.isfinite(table), axis=1)
        values = ThrusterValues(self.source, unit=self.unit, remedy=REMEDY)
        found = np.full((len(table), len(vehicle.thrusters)), np.nan)
        if known.any():
            found[known] = forces_of_thrusters(values, table[known].tolist(), vehicle, self._supplies(known))
        return array(found)

    def _supplies(self, rows: Flags) -> list[float]:
        """Supply of some rows [V], by the rows before and after that have one; empty where none was measured."""
        measured = np.flatnonzero(np.isfinite(self.supply_V))
        if not len(measured):
            return []
        # A tenth of a volt is 1 % of the force, and each voltage has curves of its own.
        found: list[float] = np.round(np.interp(np.flatnonzero(rows), measured, self.supply_V[measured]), 1).tolist()
        return found


def outputs_of(
    source: str, columns: Mapping[int, OutputColumn], numbers: Mapping[int, Array], supply_V: Array
) -> Outputs:
    """Outputs of the columns of a file.

    Parameters
    ----------
    source
        Name of the file.
    columns, numbers
        By index of the column: what it is, and its numbers (n,).
    supply_V : (n,) [V]
        NaN where not measured.

    Returns
    -------
    Outputs
        By number.

    Raises
    ------
    UsageError
        For columns of several units, and for two of one output.
    """
    units = {one.unit for one in columns.values()}
    if len(units) > 1 or len({one.number for one in columns.values()}) < len(columns):
        listed = ", ".join(f"{one.number} in {one.unit or 'a unit by size'}" for one in columns.values())
        raise UsageError(f"{source}: outputs are {listed}; wanted one column each, all in one unit")
    by_number = {one.number: array(one.factor * numbers[index]) for index, one in columns.items()}
    unit = units.pop()
    if unit == FORCES_BY_NAME:
        unit = _by_size(by_number.values())
    return Outputs(source, unit, by_number, supply_V)


def _by_size(values: Collection[Array]) -> str:
    """Unit of what is called a force: newtons, or none where shares of full throttle and pulses look so."""
    sizes = np.abs(np.concatenate([one[np.isfinite(one)] for one in values]))
    shares, pulses = sizes.max(initial=0.0) <= 1.0, sizes.min(initial=math.inf) >= SERVO_US[0]
    return "" if len(sizes) and (shares or pulses) else FORCES


def output_columns(header: Sequence[str]) -> dict[int, OutputColumn]:
    """Columns of outputs in a header line, by index."""
    return {index: found for index, cell in enumerate(header) if (found := output_of(cell))}


def supply_column(header: Sequence[str]) -> int | None:
    """Index of the first column with a supply voltage."""
    return next((index for index, cell in enumerate(header) if is_supply(cell)), None)
