"""Fossen's matrices as YAML, for simulators that are written in them (Python Vehicle Simulator, HoloOcean, MSS).

M = M_RB + M_A, D(v) = D_l + D_q |v|, B of the thrusters; everything about the center of mass, SNAME axes. What resists
is positive, as in M v' + C(v) v + D(v) v + g = tau (Fossen 2011, eq. 6.1); derivatives like X_udot have the other sign.
"""

import numpy as np
import yaml

from hindrax_analysis.exports.export_model import ExportModel, header, thrust_range_N
from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array

CONVENTIONS = (
    "M v' + C(v) v + D(v) v + g = tau, D(v) v = (D_l + D_q |v|) v. SNAME axes: x forward, y starboard, z down.",
    "All matrices are positive where they resist; X_udot = -M_A[0][0], X_u = -D_l[0][0], X_uu = -D_q[0][0], and so on.",
    "D_q and D_l have a diagonal for motion ahead and one for motion astern (heave: down, up).",
)


def write(model: ExportModel) -> str:
    """YAML text."""
    vehicle = model.vehicle
    ahead, astern = (
        np.array([model.hydrodynamics.drag(axis).of(backward=back) for axis in AXES]) for back in (False, True)
    )
    block = {
        "vehicle": vehicle.name,
        "M_RB": _rows(np.diag([vehicle.mass_kg] * 3 + list(vehicle.inertia))),
        "M_A": _rows(model.added_mass),
        "D_q": {"ahead": _row(ahead[:, 0]), "astern": _row(astern[:, 0])},
        "D_l": {"ahead": _row(ahead[:, 1]), "astern": _row(astern[:, 1])},
        "top_speed": _row(np.array(model.top_speed)),
        "g": {
            "weight_N": float(f"{vehicle.weight_N:.9g}"),
            "buoyancy_N": float(f"{vehicle.buoyancy_N:.9g}"),
            "r_gb_m": _row(np.array(model.buoyancy_arm_m)),
        },
        "B": _rows(effectiveness(vehicle)),
        "thrusters": [
            {"name": one.name, "range_N": _row(np.array(thrust_range_N(vehicle, one))), "lag_s": one.lag_s}
            for one in vehicle.thrusters
        ],
    }
    text = "".join(f"# {line}\n" for line in header(model, CONVENTIONS))
    return text + str(yaml.safe_dump(block, sort_keys=False, default_flow_style=None, width=120))


def _row(values: Array) -> list[float]:
    return [float(f"{value + 0.0:.9g}") for value in values]


def _rows(matrix: Array) -> list[list[float]]:
    return [_row(row) for row in matrix]
