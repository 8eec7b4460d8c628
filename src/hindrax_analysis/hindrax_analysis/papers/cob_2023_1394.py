"""Paper A, COB-2023-1394: thrust curve (Table 2), drag (Table 3) and drag coefficients (Table 4) of the Hindrax."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from hindrax_analysis.papers.cells import Cell, Claim, Printed, Row, slips
from hindrax_core.vehicle import GRAVITY_mps2

PAPER = "A"
DENSITY_kgpm3 = 1000.0
VISCOSITY_m2ps = 1.01e-6
STOP_us = 1500.0

VEHICLE = {"mass kg": Printed("15.22"), "volume m3": Printed("0.0153")}
NET_BUOYANCY_N = Printed("0.83")
ANGULAR_LENGTH_m = 0.59
"""Not printed; the vehicle's length is the only candidate."""

TABLE_2 = {
    "negative (1100-1500 us)": ("927.1827", "-2.2726", "0.001794", "-4.61e-7"),
    "positive (1500-1900 us)": ("174.3542", "-0.3106", "1.82e-4", "-3.52e-7"),
}
"""c1, c2, c3, c4 as printed."""

FULL_PULSE_us = {"negative (1100-1500 us)": (1100.0, "-1"), "positive (1500-1900 us)": (1900.0, "1")}


@dataclass(frozen=True, slots=True)
class PublishedDrag:
    """One row of Table 3 with its row of Table 4, as printed."""

    k_q: str
    k_l: str
    b: str
    b_std: str
    c_d: str
    c_d_std: str
    reynolds: tuple[float, float]
    angular: bool = False


TABLES_3_4 = {
    "surge": PublishedDrag("66.48", "1.25", "-0.02", "0.58", "2.28", "0.21", (0.5e5, 1.1e5)),
    "sway": PublishedDrag("75.31", "14.54", "-0.36", "0.82", "3.70", "0.33", (0.5e5, 1.1e5)),
    "heave, positive (down)": PublishedDrag("93.52", "5.26", "0.77", "0.73", "4.02", "0.74", (0.6e5, 1.8e5)),
    "heave, negative (up)": PublishedDrag("56.57", "11.84", "-0.81", "0.99", "2.48", "0.53", (0.4e5, 1.8e5)),
    "roll": PublishedDrag("1.29", "-0.12", "0.006", "0.044", "0.039", "0.0015", (1.5e5, 4e5), angular=True),
    "pitch": PublishedDrag("0.77", "-0.13", "-0.03", "0.10", "0.0224", "6.7e-4", (2.5e5, 5.5e5), angular=True),
    "yaw": PublishedDrag("0.55", "1.47", "0.02", "0.30", "0.049", "0.011", (2.5e5, 6e5), angular=True),
}


def _thrust(v: Mapping[str, float], pulse_us: float) -> float:
    return ((v["c4"] * pulse_us + v["c3"]) * pulse_us + v["c2"]) * pulse_us + v["c1"]


def _thrust_row(direction: str) -> Row:
    pulse, sign = FULL_PULSE_us[direction]
    inputs = {f"c{n}": Printed(text) for n, text in enumerate(TABLE_2[direction], start=1)}
    claims = (
        Claim(f"thrust at the stop pulse {STOP_us:.0f} us", Printed("0"), lambda v: _thrust(v, STOP_us), unit="N"),
        Claim(f"sign of the thrust at {pulse:.0f} us", Printed(sign), lambda v: float(np.sign(_thrust(v, pulse)))),
    )
    return Row(PAPER, "2", direction, inputs, claims)


def _thrust_cells(direction: str) -> list[Cell]:
    row = _thrust_row(direction)
    cells = row.judge()
    if all(cell.verdict == "agrees" for cell in cells):
        return cells
    note = _search_for_curve(row)
    # A slip that only brings two numbers back is not yet a thrust curve: it has to rise as well.
    return [cell if cell.verdict == "agrees" else replace(cell, verdict="does not follow", note=note) for cell in cells]


def _search_for_curve(row: Row) -> str:
    """Try every one-digit slip of every coefficient for a curve that is zero at stop and rises to full pulse."""
    tried, zero, found = 0, [], []
    pulses = np.linspace(STOP_us, FULL_PULSE_us[row.name][0], 21)[1:]
    tolerance = row.claims[0].tolerance(row.inputs)
    for name, number in row.inputs.items():
        for _, text in slips(number.text):
            tried += 1
            values = {key: item.value for key, item in row.inputs.items()} | {name: float(text)}
            forces = np.array([_thrust(values, float(pulse)) for pulse in pulses])
            if abs(_thrust(values, STOP_us)) <= tolerance:
                zero.append(f"{name} = {text} (thrust {forces[-1]:.2f} N at {pulses[-1]:.0f} us)")
                if bool(np.all(np.diff(forces) * (pulses[-1] - STOP_us) > 0.0)) and abs(forces[-1]) > tolerance:
                    found.append(f"{name} = {text}")
    if found:
        return f"a curve comes out with {', '.join(found)}"
    near = f"; zero at stop only with {', '.join(zero)}" if zero else ""
    return f"none of {tried} one-digit slips in the four coefficients gives a curve that rises from zero{near}"


def drag_coefficient(drag: PublishedDrag, v: Mapping[str, float], length_m: float = ANGULAR_LENGTH_m) -> float:
    """Mean over the Reynolds range of F / (1/2 rho A x^2); A is V^(2/3), for a rotation L^5. Text to Table 4."""
    if drag.angular:
        size, reference = length_m**2, length_m**5
    else:
        size, reference = float(np.cbrt(v["volume m3"])), float(np.cbrt(v["volume m3"])) ** 2
    rate = np.linspace(*drag.reynolds, 201) * VISCOSITY_m2ps / size
    force = v["k_q"] * rate**2 + v["k_l"] * rate + v["b"]
    return float(np.mean(force / (0.5 * DENSITY_kgpm3 * reference * rate**2)))


def _length_note(drag: PublishedDrag, inputs: Mapping[str, Printed]) -> str:
    """Sentence with the length for which the printed C_D would come out."""
    values = {name: number.value for name, number in inputs.items()}
    length = brentq(lambda trial: drag_coefficient(drag, values, trial) - float(drag.c_d), 0.3, 1.0)
    return f"with L = {ANGULAR_LENGTH_m} m, which is not printed; L = {length:.3f} m would give the printed value"


def _drag_row(motion: str) -> Row:
    drag = TABLES_3_4[motion]
    inputs = {
        "k_q": Printed(drag.k_q),
        "k_l": Printed(drag.k_l),
        "b": Printed(drag.b),
        "volume m3": VEHICLE["volume m3"],
    }
    claim = Claim(
        "C_D",
        Printed(drag.c_d),
        lambda v: drag_coefficient(drag, v),
        absolute=float(drag.c_d_std),
        note=_length_note(drag, inputs) if drag.angular else "",
    )
    return Row(PAPER, "4", motion, inputs, (claim,), exact=frozenset({"volume m3"}))


def _buoyancy_rows() -> list[Row]:
    def net(v: Mapping[str, float]) -> float:
        return (DENSITY_kgpm3 * v["volume m3"] - v["mass kg"]) * GRAVITY_mps2

    stated = Claim("net buoyancy", NET_BUOYANCY_N, net, note="one digit of the volume is worth 0.98 N", unit="N")
    rows = [Row(PAPER, "vehicle", "Hindrax", VEHICLE, (stated,))]
    for motion in ("heave, positive (down)", "heave, negative (up)"):
        drag = TABLES_3_4[motion]
        size = Printed(drag.b.removeprefix("-"))
        note = f"b = {drag.b}: buoyancy lifts"
        claim = Claim("|b| is the net buoyancy", size, net, absolute=float(drag.b_std), note=note, unit="N")
        rows.append(Row(PAPER, "3", motion, VEHICLE, (claim,), exact=frozenset(VEHICLE)))
    return rows


def recompute() -> list[Cell]:
    """Thrust curves, drag coefficients, net buoyancy. Tolerance: printed digits, or the printed deviation."""
    cells = [cell for direction in TABLE_2 for cell in _thrust_cells(direction)]
    rows = [_drag_row(motion) for motion in TABLES_3_4] + _buoyancy_rows()
    return cells + [cell for row in rows for cell in row.judge()]
