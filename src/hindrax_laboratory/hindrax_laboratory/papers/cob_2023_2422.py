"""Paper B, COB-2023-2422: added mass of a 1:3 model of the Hindrax by free oscillation. Table 4 and Table 6."""

from collections.abc import Mapping
from dataclasses import replace
from statistics import mean, stdev

from hindrax_laboratory.free_decay import (
    added_mass_damped,
    added_mass_undamped,
    keulegan_carpenter,
    linear_damping,
    scaled_added_mass,
)
from hindrax_laboratory.papers.cells import Cell, Claim, Printed, Row

PAPER = "B"
MODEL = {"mass kg": Printed("0.39"), "volume m3": Printed("0.00056")}
PROTOTYPE_VOLUME_m3 = Printed("0.0153")
DENSITY_kgpm3 = 1000.0

DAMPING_TOLERANCE = 0.004
"""Relative, of c (6): its row of zeta has three digits."""


COLUMNS = ("direction", "k", "A", "w_d", "zeta", "c (6)", "m_ad (7)", "m_ad (5)", "error (11)", "KC (9)")
TABLE_4 = [
    dict(zip(COLUMNS, row.split(), strict=True))
    for row in (
        "surge 1127.7 4 36.7824 0.0713 4.35 0.4435 0.4401 0.77 0.30",
        "sway 1127.7 5 31.7580 0.1155 8.14 0.7281 0.7132 2.09 0.38",
        "heave 1127.7 6 30.3976 0.0604 4.47 0.8304 0.8260 0.53 0.46",
        "heave 1127.7 20 30.1326 0.1154 8.56 0.8454 0.8289 1.99 1.52",
        "heave 1127.7 25 29.966 0.172 12.75 0.8658 0.8287 4.48 1.90",
        "heave 659.9 20 23.1477 0.1328 7.57 0.8416 0.8198 2.66 1.52",
        "heave 659.9 25 23.0504 0.1656 9.48 0.8520 0.8179 4.17 1.90",
        "heave 659.9 30 23.0629 0.1518 8.69 0.8506 0.8220 3.48 2.28",
        "heave 659.9 35 22.9846 0.1702 9.77 0.8591 0.8229 4.40 2.66",
        "heave 659.9 40 23.0505 0.1613 9.23 0.8520 0.8197 3.94 3.05",
        "heave 659.9 45 22.8966 0.1992 11.48 0.8687 0.8187 6.10 3.43",
    )
]
"""As printed; k [N/m], A [mm], w_d [rad/s]."""

HEAVE_MEAN = (Printed("0.8227"), Printed("0.0042"))

TABLE_6 = {
    "surge": (Printed("0.79"), Printed("12.08")),
    "sway": (Printed("1.27"), Printed("19.43")),
    "heave": (Printed("1.4692"), Printed("22.48")),
}


def _damped(v: Mapping[str, float]) -> float:
    return added_mass_damped(v["k"], v["w_d"], v["zeta"], v["mass kg"])


def _undamped(v: Mapping[str, float]) -> float:
    return added_mass_undamped(v["k"], v["w_d"], v["mass kg"])


def _damping(v: Mapping[str, float], added_mass: float) -> float:
    return linear_damping(v["k"], v["zeta"], v["mass kg"], added_mass)


def _row(test: Mapping[str, str]) -> Row:
    printed = {name: Printed(test[name]) for name in COLUMNS[1:]}
    claims = (
        Claim("m_ad (7)", printed["m_ad (7)"], _undamped, unit="kg"),
        Claim("m_ad (5)", printed["m_ad (5)"], _damped, absolute=0.001, unit="kg"),
        Claim("error (11)", printed["error (11)"], lambda v: 100.0 * (v["m_ad (7)"] / v["m_ad (5)"] - 1.0), unit="%"),
        Claim("c (6)", printed["c (6)"], lambda v: _damping(v, _damped(v)), relative=DAMPING_TOLERANCE, unit="N s/m"),
        Claim("KC (9)", printed["KC (9)"], lambda v: keulegan_carpenter(1e-3 * v["A"], v["volume m3"])),
    )
    inputs = {name: printed[name] for name in ("k", "w_d", "zeta", "A", "m_ad (7)", "m_ad (5)")}
    # The oscillating mass is the model's constant: a tenth of its digit would move every row alike.
    name = f"{test['direction']} {test['A']} mm, k = {test['k']} N/m"
    return Row(PAPER, "4", name, inputs | MODEL, claims, exact=frozenset({"mass kg", "A"}))


def _judged(row: Row) -> list[Cell]:
    """Cells of a row of Table 4; a note marks where c follows from the added mass of (7) instead of (5)."""
    cells = row.judge()
    if cells[3].verdict != "agrees":
        other = replace(row.claims[3], formula=lambda v: _damping(v, _undamped(v)))
        instead = replace(row, claims=(other,)).judge()[0]
        if instead.verdict == "agrees":
            note = f"it follows with m_ad of (7): {instead.recomputed:.2f}"
            cells[3] = replace(cells[3], note="; ".join(filter(None, (note, cells[3].note))))
    return cells


def _mean_row() -> Row:
    heave = {f"m_ad {i}": Printed(test["m_ad (5)"]) for i, test in enumerate(TABLE_4) if test["direction"] == "heave"}
    claims = (
        Claim("mean m_ad (5)", HEAVE_MEAN[0], lambda v: mean(v.values()), unit="kg"),
        Claim("standard deviation", HEAVE_MEAN[1], lambda v: stdev(v.values()), unit="kg"),
    )
    return Row(PAPER, "4", "heave, mean of nine", heave, claims)


def _result_row(direction: str) -> Row:
    added = {test["direction"]: Printed(test["m_ad (5)"]) for test in TABLE_4} | {"heave": HEAVE_MEAN[0]}
    coefficient, mass = TABLE_6[direction]

    def prototype(v: Mapping[str, float]) -> float:
        return scaled_added_mass(v["C_M"], DENSITY_kgpm3, v["prototype m3"])

    inputs = {"m_ad": added[direction], "C_M": coefficient, "prototype m3": PROTOTYPE_VOLUME_m3}
    inputs["volume m3"] = MODEL["volume m3"]
    claims = (
        Claim("C_M (8)", coefficient, lambda v: v["m_ad"] / (DENSITY_kgpm3 * v["volume m3"])),
        Claim("prototype m_ad (12)", mass, prototype, unit="kg"),
    )
    return Row(PAPER, "6", direction, inputs, claims, exact=frozenset({"volume m3", "prototype m3"}))


def recompute() -> list[Cell]:
    """All cells of Table 4 and Table 6. Tolerance: the printed digits; 0.001 kg for m_ad (5); 0.4 % for c."""
    cells = [cell for test in TABLE_4 for cell in _judged(_row(test))]
    rows = (_mean_row(), *(_result_row(direction) for direction in TABLE_6))
    return cells + [cell for row in rows for cell in row.judge()]
