"""Options of the processes of a stack: one description for `hindrax up`, `pool-test` and `ros2 launch`."""

import difflib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

from hindrax_bringup.network import security
from hindrax_bringup.processes import EVERY, Process
from hindrax_core.errors import UsageError
from hindrax_core.topics import NAMESPACE, namespace_arguments, namespace_fault
from hindrax_ros.parameter_file import FRAME_PREFIX, names_node, parameter_blocks

Blocks = dict[str, dict[str, object]]
"""Parameters by the pattern of the nodes that get them, as in a ROS parameter file; of two the later one wins."""
NODES = tuple(dict.fromkeys(node for process in EVERY for node in process.nodes))
"""Of every vehicle, and sensors under the names of their kinds."""


@dataclass(frozen=True, slots=True)
class ParameterOverrides:
    """Settings of a user: namespace of the vehicle, a ROS parameter file, single parameters `node.name:=value`."""

    namespace: str = NAMESPACE
    file: str = ""
    settings: tuple[str, ...] = ()
    sensors: tuple[str, ...] = field(default=(), compare=False)
    """Names of the vehicle's sensors, which are nodes."""
    frame_prefix: str = ""
    """Of all frames, such as `rov1/`."""

    def __post_init__(self) -> None:
        """Check all of it before anything starts, or a folder is made for it."""
        if wrong := namespace_fault(self.namespace):
            raise UsageError(f"namespace: {wrong}")
        blocks = read_parameters(self.file)
        for text in self.settings:
            self.apply(blocks, text)

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of all nodes."""
        return (*NODES, *(name for name in self.sensors if name not in NODES))

    def apply(self, blocks: Blocks, text: str) -> None:
        """Put one parameter, `node.name:=value`, into the blocks; UsageError names what is wrong with it."""
        apply_setting(blocks, text, self.namespace, self.nodes)


@dataclass(frozen=True, slots=True)
class NodeOptions:
    """All options of the nodes of one stack."""

    vehicle: str
    tuning: ParameterOverrides = field(default_factory=ParameterOverrides)
    bag: str = ""
    notes: str = ""
    without_operator: str = ""
    wires: Mapping[str, object] | None = None
    """Ports of simulated hardware, its clock, and the truth about it where it is known; None for the real one."""
    more: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Further ROS arguments by process."""

    def parameters(self) -> Blocks:
        """Parameters of all nodes; what the user gives wins. UsageError when it cannot be read."""
        blocks: Blocks = {"/**": {"vehicle": self.vehicle}}
        if self.tuning.frame_prefix:
            blocks["/**"][FRAME_PREFIX] = self.tuning.frame_prefix
        if self.wires is not None:
            blocks["/**"]["use_sim_time"] = True
            blocks |= wire_parameters(self.wires)
        if self.bag:
            truth = json.dumps(self.wires.get("truth", {})) if self.wires is not None else ""
            blocks["/**/recorder"] = {"bag": self.bag, "notes": self.notes, "truth": truth}
        if self.without_operator:
            blocks["/**/safety_monitor"] = {"without_operator": self.without_operator}
        for pattern, block in read_parameters(self.tuning.file).items():
            blocks.setdefault(pattern, {}).update(block)
        for text in self.tuning.settings:
            self.tuning.apply(blocks, text)
        return blocks

    def arguments(self, process: Process) -> list[str]:
        """ROS arguments of one process, beside those that name its parameters."""
        namespace = self.tuning.namespace
        return [
            *namespace_arguments(namespace, own_clock=self.wires is not None),
            *security.arguments(process.name, namespace),
            *self.more.get(process.name, ()),
        ]

    def unknown_blocks(self) -> list[str]:
        """Return a sentence for each block of the user's file that names no node of the stack."""
        names = [f"{self.tuning.namespace}/{node}" for node in self.tuning.nodes]
        return [
            f"{self.tuning.file}: {pattern!r} names no node of this stack, ignored; wanted such as '/**/{NODES[0]}'"
            for pattern in read_parameters(self.tuning.file)
            if not any(names_node(pattern, name) for name in names)
        ]


def wire_parameters(wires: Mapping[str, Any]) -> Blocks:
    """Ports and clock of simulated hardware as parameters of the nodes that use them."""
    return {f"/**/{node}": {"port": port, "clock": wires["clock"]} for node, port in wires["ports"].items()}


def read_parameters(file: str) -> Blocks:
    """Blocks of a ROS parameter file; empty without one. UsageError when it is invalid."""
    if not file:
        return {}
    blocks: Blocks = {}
    for pattern, values in parameter_blocks(file):
        if values is None:
            raise UsageError(f"parameter file {file}: found {pattern!r}, wanted blocks NODE: {{ros__parameters: ...}}")
        blocks[pattern] = values
    return blocks


def apply_setting(blocks: Blocks, text: str, namespace: str, nodes: Sequence[str]) -> None:
    """Put one parameter into the blocks, wherever it stands already.

    Parameters
    ----------
    blocks
        Parameters by the pattern of the nodes that have them; changed in place.
    text
        "node.name:=value", with a value in YAML.
    namespace
        Of the nodes, with its leading slash.
    nodes
        Names of all nodes.

    Raises
    ------
    UsageError
        Where the text has another form, no node has this name, or the value is no YAML.
    """
    names, assigned, value = text.partition(":=")
    node, dot, name = names.partition(".")
    if not (assigned and dot and name):
        raise UsageError(f"--set {text!r}: wanted node.name:=value, as pilot.holds.turn_radps:=0.3")
    if node not in nodes:
        near = difflib.get_close_matches(node, nodes, n=1) or nodes
        raise UsageError(f"--set {text!r}: no node is called {node!r}; the nearest is {near[0]!r}")
    try:
        parsed = yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise UsageError(f"--set {text!r}: the value is no YAML ({' '.join(str(error).split())})") from error
    own = f"/**/{node}"
    blocks.setdefault(own, {})
    for pattern, block in blocks.items():
        # Every block that has it gets the value: whichever ROS takes last, it is the one that was set.
        if pattern == own or (name in block and names_node(pattern, f"{namespace}/{node}")):
            block[name] = parsed
