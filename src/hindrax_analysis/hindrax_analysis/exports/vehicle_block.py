"""Our own vehicle file: the `hydrodynamics` block, as `hindrax_core.vehicle` reads it."""

import yaml

from hindrax_analysis.exports.export_model import ExportModel, header
from hindrax_core.vehicle import AXES, Hydrodynamics

CONVENTIONS = (
    "Block for the vehicle file. All numbers are positive: they resist. SNAME axes, heave positive down.",
    "k_q_negative and k_l_negative hold for motion in the negative direction (heave: up).",
)


def write(model: ExportModel) -> str:
    """YAML text: one key, hydrodynamics."""
    return "".join(f"# {line}\n" for line in header(model, CONVENTIONS)) + block_text(model.hydrodynamics)


def block_text(hydrodynamics: Hydrodynamics) -> str:
    """YAML text of the block, to be put into a vehicle file."""
    block: dict[str, object] = {"added_mass": [_rounded(value) for value in hydrodynamics.added_mass]}
    for axis in AXES:
        drag = hydrodynamics.drag(axis)
        values = {name: getattr(drag, name) for name in ("k_q", "k_l", "k_q_negative", "k_l_negative")}
        block[axis] = {name: _rounded(value) for name, value in values.items() if value is not None}
    if hydrodynamics.added_mass_cross:
        block["added_mass_cross"] = [[_rounded(value) for value in row] for row in hydrodynamics.added_mass_cross]
    text: str = yaml.safe_dump({"hydrodynamics": block}, sort_keys=False, width=120, default_flow_style=None)
    return text


def _rounded(value: float) -> float:
    return float(f"{value:.9g}")
