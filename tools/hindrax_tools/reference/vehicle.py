"""Page of the vehicle file, from the dataclasses that check it."""

from __future__ import annotations

from hindrax_core.curves.curve_branches import Branch, Curve
from hindrax_core.vehicle import Drag, Hydrodynamics, Mount, Output, Thruster, Vehicle
from hindrax_tools.reference.knob_table import knob_table
from hindrax_tools.reference.markdown import head

ABOUT = """What a vehicle *is*: one YAML file, `src/hindrax_bringup/vehicles/hindrax.yaml` for the Hindrax. SI
units, SNAME axes (x forward, y starboard, z down), positions from the body origin, the center of the envelope. A
file that is wrong is refused with the key path, what was found and what was wanted."""

BLOCKS = (
    ("The file", Vehicle),
    ("thrusters: a list of", Thruster),
    ("curves: by name", Curve),
    ("negative and positive of a curve", Branch),
    ("hydrodynamics", Hydrodynamics),
    ("surge to yaw of hydrodynamics", Drag),
    ("sensors: by name", Mount),
    ("output", Output),
)


def page() -> str:
    """Return the page."""
    blocks = (
        f"\n## {title}\n\n{(kind.__doc__ or '').partition(chr(10))[0]}\n\n{knob_table(kind)}" for title, kind in BLOCKS
    )
    return head("Vehicle file", ABOUT) + "".join(blocks)
