"""Paper E, Badawy, Omer 2012: drag from CFD (table 5) and the coefficients fitted to it."""

from collections.abc import Mapping

import numpy as np

from hindrax_laboratory import towing
from hindrax_laboratory.papers.cells import Cell, Claim, Printed, Row

PAPER = "E"

SPEEDS = ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0"]
FORCES = ["6.204", "12.416", "18.636", "24.864", "31.1", "37.344", "43.596", "49.856", "56.124", "62.40"]
"""Speed [m/s] and drag [N], as printed in table 5."""


def _fit(forces: Mapping[str, float]) -> towing.Towing:
    return towing.fit(np.array(SPEEDS, dtype=float), np.array([forces[speed] for speed in SPEEDS]))


def recompute() -> list[Cell]:
    """The fit and the forces of table 5. Tolerance: the printed digits of the result; speeds and forces are exact."""
    printed = {speed: Printed(force) for speed, force in zip(SPEEDS, FORCES, strict=True)}
    claims = (
        Claim("K_L", Printed("61.89"), lambda v: _fit(v).k_l.value, unit="N s/m"),
        Claim("K_Q", Printed("0.398"), lambda v: _fit(v).k_q.value, unit="N s^2/m^2"),
    )
    rows = [Row(PAPER, "5", "least squares through the origin", printed, claims, exact=frozenset(printed))]
    # The force of the recomputed fit at each speed: a table that was itself computed must come back whole.
    fit = _fit({speed: force.value for speed, force in printed.items()})
    k_l, k_q = round(fit.k_l.value, 6), round(fit.k_q.value, 6)
    note = f"K_L = {k_l:g}, K_Q = {k_q:g}"
    for speed, force in printed.items():
        claim = Claim("drag", force, lambda v: k_l * v["v"] + k_q * v["v"] ** 2, note=note, unit="N")
        rows.append(Row(PAPER, "5", f"{speed} m/s", {"v": Printed(speed)}, (claim,), exact=frozenset({"v"})))
    return [cell for row in rows for cell in row.judge()]
