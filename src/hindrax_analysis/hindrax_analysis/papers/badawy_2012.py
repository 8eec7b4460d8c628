"""Paper E, Badawy, Omer 2012: drag from CFD (table 5) and the coefficients fitted to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hindrax_analysis.experiments import towing
from hindrax_analysis.papers.cells import Cell, Claim, Printed, Row

PAPER = "E"

TABLE_5 = {
    "0.1": "6.204",
    "0.2": "12.416",
    "0.3": "18.636",
    "0.4": "24.864",
    "0.5": "31.1",
    "0.6": "37.344",
    "0.7": "43.596",
    "0.8": "49.856",
    "0.9": "56.124",
    "1.0": "62.40",
}
"""Speed [m/s] and drag [N], as printed."""

FITTED = {"k_l": Printed("61.89"), "k_q": Printed("0.398")}


def _fit(forces: Mapping[str, float]) -> towing.Towing:
    speeds = np.array([float(speed) for speed in TABLE_5])
    return towing.fit(speeds, np.array([forces[speed] for speed in TABLE_5]))


def _fit_row() -> Row:
    claims = (
        Claim("K_L", FITTED["k_l"], lambda v: _fit(v).k_l.value, unit="N s/m"),
        Claim("K_Q", FITTED["k_q"], lambda v: _fit(v).k_q.value, unit="N s^2/m^2"),
    )
    forces = {speed: Printed(force) for speed, force in TABLE_5.items()}
    return Row(PAPER, "5", "least squares through the origin", forces, claims, exact=frozenset(forces))


def _force_rows() -> list[Row]:
    """Force of the recomputed fit at each speed: a table that was itself computed must come back whole."""
    fit = _fit({speed: float(force) for speed, force in TABLE_5.items()})
    k_l, k_q = round(fit.k_l.value, 6), round(fit.k_q.value, 6)
    rows = []
    for speed, force in TABLE_5.items():
        note = f"K_L = {k_l:g}, K_Q = {k_q:g}"
        claim = Claim("drag", Printed(force), lambda v: k_l * v["v"] + k_q * v["v"] ** 2, note=note, unit="N")
        rows.append(Row(PAPER, "5", f"{speed} m/s", {"v": Printed(speed)}, (claim,), exact=frozenset({"v"})))
    return rows


def recompute() -> list[Cell]:
    """The fit and the forces of table 5. Tolerance: the printed digits of the result; speeds and forces are exact."""
    return [cell for row in (_fit_row(), *_force_rows()) for cell in row.judge()]
