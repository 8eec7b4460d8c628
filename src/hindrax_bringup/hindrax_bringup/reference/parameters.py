"""Page of the parameters of every node, from the knobs they are declared with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hindrax_bag.limits import Limits
from hindrax_bringup.reference.knob_table import knob_table
from hindrax_bringup.reference.markdown import head
from hindrax_control.allocation import AllocationKnobs
from hindrax_control.guard import CommandGuardKnobs
from hindrax_control.hand import HandKnobs
from hindrax_control.navigator import NavigatorKnobs
from hindrax_control.pilot import PilotKnobs
from hindrax_control.supply import SupplyKnobs
from hindrax_drivers.arming import GuardKnobs
from hindrax_drivers.registry import DEVICES
from hindrax_ident.tuning import Tuning

ABOUT = """How the nodes are tuned. Each parameter is declared once, with its range; a value outside of it stops the
node with a sentence that names it. Set them in a ROS parameter file:

    /**/pilot:
      ros__parameters:
        holds.turn_radps: 0.3

and start the node with `--ros-args --params-file FILE`. They are fixed while a node runs. Every node also has
`vehicle` (the vehicle file); sensors and thrusters have `port` and `clock`, which stand for those of the vehicle
file in mock."""

NODES: Mapping[str, tuple[type[Any], ...]] = {
    **{name: (row.knobs,) for name, row in DEVICES.items()},
    "thrusters": (GuardKnobs,),
    "navigator": (NavigatorKnobs,),
    "pilot": (PilotKnobs,),
    "allocator": (AllocationKnobs, CommandGuardKnobs, SupplyKnobs),
    "hand": (HandKnobs,),
    "identifier": (Tuning,),
    "recorder": (Limits,),
}
"""Dataclasses of knobs that each node declares as its parameters."""


def page() -> str:
    """Return the page."""
    nodes = (f"\n## {name}\n\n{_first_lines(kinds)}\n\n{knob_table(*kinds)}" for name, kinds in NODES.items())
    return head("Parameters", ABOUT) + "".join(nodes)


def _first_lines(kinds: tuple[type[Any], ...]) -> str:
    return " ".join((kind.__doc__ or "").partition("\n")[0] for kind in kinds)
