"""Pages of what is set: the parameters of every node and the vehicle file, from their dataclasses of knobs."""

import math
import types
import typing
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from hindrax_core.knobs import Knob, knob_of
from hindrax_core.thrust.curves import Branch, Curve
from hindrax_core.thrust.table import ThrustTable
from hindrax_core.vehicle import Drag, Hydrodynamics, Mount, Output, Thruster, Vehicle
from hindrax_operator.node_parameters import NODES
from hindrax_tools.reference.markdown import code, head, number, table

ABOUT = """How the nodes are tuned. Each parameter is declared once, with its range; a value outside of it stops the
node with an error that names it. Set them in a ROS parameter file:

    /**/pilot:
      ros__parameters:
        holds.turn_radps: 0.3

and start the node with `--ros-args --params-file FILE`; `./hindrax up` and `pool-test` take `--params FILE` and
`--set pilot.holds.turn_radps:=0.3`, launch files `params_file:=FILE`. A whole number is accepted for a float.

Holds, maneuvers, pool, allocation, identification, teleoperation and limits of the bag can be changed while the node
runs (`ros2 param set /hindrax/pilot holds.turn_radps 0.2`); a maneuver in flight keeps what it began with. What guards
the vehicle (`guards`, `operator_wrench`, wrench limits of the allocator, thrusters, estimator health, safety monitor)
and what a node uses only as it starts (devices, navigator) is refused with the reason. Every node also has `vehicle`
(the vehicle file); sensors and thrusters have `port` and `clock`, which override those of the vehicle file in mock. A
parameter that no node has, and a value out of its range, are refused by `up` and `pool-test` before anything starts; a
node that is started otherwise logs a warning for each given parameter that it does not declare."""
VEHICLE_FILE = """What a vehicle *is*: one YAML file, `src/hindrax_bringup/vehicles/hindrax.yaml` for the Hindrax. SI
units, SNAME axes (x forward, y starboard, z down), positions from the body origin, the center of the envelope. A
file that is wrong is refused with the key path, what was found and what was wanted."""

BLOCKS = (
    ("The file", Vehicle),
    ("thrusters: a list of", Thruster),
    ("curves: by name", Curve),
    ("negative and positive of a curve", Branch),
    ("table of a curve", ThrustTable),
    ("hydrodynamics", Hydrodynamics),
    ("surge to yaw of hydrodynamics", Drag),
    ("sensors: by name", Mount),
    ("output", Output),
)


def page() -> str:
    """Page of the parameters."""
    nodes = (
        f"\n## {name}\n\n{' '.join(map(_first_line, kinds))}\n\n{knob_table(*kinds)}" for name, kinds in NODES.items()
    )
    return head("Parameters", ABOUT) + "".join(nodes)


def vehicle_page() -> str:
    """Page of the vehicle file."""
    blocks = (f"\n## {title}\n\n{_first_line(kind)}\n\n{knob_table(kind)}" for title, kind in BLOCKS)
    return head("Vehicle file", VEHICLE_FILE) + "".join(blocks)


def _first_line(kind: type[object]) -> str:
    return (kind.__doc__ or "").partition("\n")[0]


def knob_table(*kinds: type[object]) -> str:
    """One table of all knobs of some dataclasses."""
    return table(("name", "default", "range", "unit", "meaning"), [row for kind in kinds for row in rows(kind)])


def rows(kind: type[Any], prefix: str = "") -> Iterator[tuple[str, ...]]:
    """A row per knob; those of a nested dataclass as `field.knob`."""
    hints = typing.get_type_hints(kind)
    for declared in fields(kind):
        inner = hints[declared.name]
        if is_dataclass(inner):
            yield from rows(typing.cast("type[Any]", inner), f"{prefix}{declared.name}.")
        else:
            yield _row(prefix + declared.name, declared, inner)


def _row(name: str, declared: Field[object], hint: object) -> tuple[str, ...]:
    knob = knob_of(declared)
    meaning = knob.meaning.removesuffix(f"[{knob.unit}]").strip() if knob.unit else knob.meaning
    return code(name), _default(declared), _range(knob, hint), "" if knob.unit == "-" else knob.unit, meaning


def _default(declared: Field[object]) -> str:
    if declared.default is not MISSING:
        return _plain(declared.default)
    if declared.default_factory is not MISSING:
        return _plain(declared.default_factory())
    return "required"


def _plain(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_plain, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return double(value) if isinstance(value, float) else number(value)
    return "none" if value is None or value in ("", {}) else str(value)


def double(value: float) -> str:
    """A number as ROS reads a double: never like an integer."""
    text = number(value)
    return text if set(text) & set(".en") else f"{text}.0"


def _range(knob: Knob, hint: object) -> str:
    if knob.choices:
        return ", ".join(map(code, knob.choices))
    if bool in (hint, *typing.get_args(hint)):
        return "true, false"
    if typing.get_origin(hint) in (types.UnionType, typing.Union) and math.isinf(knob.low):
        return ""
    low, high = ("" if math.isinf(bound) else number(bound) for bound in (knob.low, knob.high))
    return f"{low} to {high}".strip() if low or high else ""
