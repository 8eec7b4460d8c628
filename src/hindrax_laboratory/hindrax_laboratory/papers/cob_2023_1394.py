"""Paper A, COB-2023-1394: thrust curve (Table 2), drag (Table 3) and drag coefficients (Table 4) of the Hindrax."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from hindrax_analysis.published import PUBLISHED, Published
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_laboratory.papers.cells import Cell, Claim, Printed, Row, slips

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


ROTATIONS = ("roll", "pitch", "yaw")
HEAVE = {"heave_down": "heave, positive (down)", "heave_up": "heave, negative (up)"}
"""Names of motions in the paper; the others are as ours."""


def _thrust(v: Mapping[str, float], pulse_us: float) -> float:
    return ((v["c4"] * pulse_us + v["c3"]) * pulse_us + v["c2"]) * pulse_us + v["c1"]


def _thrust_cells(direction: str) -> list[Cell]:
    pulse, sign = FULL_PULSE_us[direction]
    inputs = {f"c{n}": Printed(text) for n, text in enumerate(TABLE_2[direction], start=1)}
    claims = (
        Claim(f"thrust at the stop pulse {STOP_us:.0f} us", Printed("0"), lambda v: _thrust(v, STOP_us), unit="N"),
        Claim(f"sign of the thrust at {pulse:.0f} us", Printed(sign), lambda v: float(np.sign(_thrust(v, pulse)))),
    )
    row = Row(PAPER, "2", direction, inputs, claims)
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
    tolerance = row.tolerance(row.claims[0])
    for name, number in row.inputs.items():
        for _, text in slips(number.text):
            tried += 1
            values = row.values | {name: float(text)}
            forces = np.array([_thrust(values, float(pulse)) for pulse in pulses])
            if abs(_thrust(values, STOP_us)) <= tolerance:
                zero.append(f"{name} = {text} (thrust {forces[-1]:.2f} N at {pulses[-1]:.0f} us)")
                if bool(np.all(np.diff(forces) * (pulses[-1] - STOP_us) > 0.0)) and abs(forces[-1]) > tolerance:
                    found.append(f"{name} = {text}")
    if found:
        return f"a curve comes out with {', '.join(found)}"
    near = f"; zero at stop only with {', '.join(zero)}" if zero else ""
    return f"none of {tried} one-digit slips in the four coefficients gives a curve that rises from zero{near}"


def drag_coefficient(motion: str, v: Mapping[str, float], length_m: float = ANGULAR_LENGTH_m) -> float:
    """Mean over the Reynolds range of F / (1/2 rho A x^2); A is V^(2/3), for a rotation L^5. Text to Table 4.

    Parameters
    ----------
    motion
        Of the table.
    v
        Numbers of its row.
    length_m : [m]
        L of a rotation.

    Returns
    -------
    float
        [-].
    """
    if motion in ROTATIONS:
        size, reference = length_m**2, length_m**5
    else:
        size, reference = float(np.cbrt(v["volume m3"])), float(np.cbrt(v["volume m3"])) ** 2
    rate = np.linspace(*PUBLISHED[motion].reynolds, 201) * VISCOSITY_m2ps / size
    force = v["k_q"] * rate**2 + v["k_l"] * rate + v["b"]
    return float(np.mean(force / (0.5 * DENSITY_kgpm3 * reference * rate**2)))


def _drag_row(motion: str, drag: Published) -> Row:
    inputs = {name: Printed(getattr(drag, name).split()[0]) for name in ("k_q", "k_l", "b")}
    inputs["volume m3"] = VEHICLE["volume m3"]
    c_d, c_d_std = drag.drag_coefficient
    note = ""
    if motion in ROTATIONS:
        values = {name: number.value for name, number in inputs.items()}
        length = brentq(lambda trial: drag_coefficient(motion, values, trial) - c_d, 0.3, 1.0)
        note = f"with L = {ANGULAR_LENGTH_m} m, which is not printed; L = {length:.3f} m would give the printed value"
    printed = Printed(drag.c_d.split()[0])
    claim = Claim("C_D", printed, lambda v: drag_coefficient(motion, v), absolute=c_d_std, note=note)
    return Row(PAPER, "4", HEAVE.get(motion, motion), inputs, (claim,), exact=frozenset({"volume m3"}))


def _buoyancy_rows() -> list[Row]:
    def net(v: Mapping[str, float]) -> float:
        return (DENSITY_kgpm3 * v["volume m3"] - v["mass kg"]) * GRAVITY_mps2

    stated = Claim("net buoyancy", NET_BUOYANCY_N, net, note="one digit of the volume is worth 0.98 N", unit="N")
    rows = [Row(PAPER, "vehicle", "Hindrax", VEHICLE, (stated,))]
    for motion, name in HEAVE.items():
        b, b_std = PUBLISHED[motion].b.split()
        note = f"b = {b}: buoyancy lifts"
        size = Printed(b.removeprefix("-"))
        claim = Claim("|b| is the net buoyancy", size, net, absolute=float(b_std), note=note, unit="N")
        rows.append(Row(PAPER, "3", name, VEHICLE, (claim,), exact=frozenset(VEHICLE)))
    return rows


def recompute() -> list[Cell]:
    """Thrust curves, drag coefficients, net buoyancy. Tolerance: printed digits, or the printed deviation."""
    cells = [cell for direction in TABLE_2 for cell in _thrust_cells(direction)]
    rows = [_drag_row(motion, drag) for motion, drag in PUBLISHED.items()] + _buoyancy_rows()
    return cells + [cell for row in rows for cell in row.judge()]
