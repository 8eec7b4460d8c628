"""Vehicle and port of the output, read from the process arguments without ROS: the dead man needs them at once.

Follows ROS 2: `--params-file FILE` with blocks per node (wildcards `*` and `**`), and `-p NAME:=VALUE`; what comes
later wins.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise

import yaml

from hindrax_core.errors import UsageError
from hindrax_core.knobs import build, knob
from hindrax_core.thrust.curves import Branch, Curve
from hindrax_core.topics import NAMESPACE
from hindrax_core.vehicle import Output, Thruster, Vehicle, load_vehicle
from hindrax_drivers.output.output_guard import OutputGuard, OutputGuardKnobs, guard_of
from hindrax_ros.parameter_file import names_node, parameter_blocks

NODE = "thrusters"
KEEPALIVE_S = 0.2
"""Period of the keepalives from the dead man to the node [wall time]."""
STOP_WORD, DISARMED_WORD = b"s", b"d"
"""Among the keepalives: disarm. Among the beats of the node: disarmed since, and neutral was written."""
BEAT_WORD, ARMED_WORD = b"!", b"a"
"""A beat of the node, and one while it is armed, or may have left an autopilot so."""
ENDED = "HINDRAX_OUTPUT_ENDED"
"""Environment of a node that the dead man has started again: how the one before it ended."""
LEFT_ARMED = "HINDRAX_OUTPUT_LEFT_ARMED"
"""Environment of one whose predecessor has armed an autopilot that nobody could disarm since."""
NO_VEHICLE = Vehicle("no vehicle", mass_kg=1.0, volume_m3=1e-3, envelope_m=(0.1, 0.1, 0.1))
"""For a device that stands alone: nothing is known of what it is on."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Vehicle, port of its output, the clock of a serial port ("system" or "mock:SOCKET"), and the guard's knobs."""

    vehicle: Vehicle
    port: str
    clock: str = "system"
    alone: bool = False
    """Whether there is no vehicle file."""
    knobs: OutputGuardKnobs = field(default_factory=OutputGuardKnobs)
    arguments: tuple[str, ...] = ()
    """What they were read from, for another process of the same output."""

    @property
    def guard(self) -> OutputGuard:
        """The guard of this output: its neutral is that of the dead man too."""
        return guard_of(self.vehicle, self.knobs)


@dataclass(frozen=True, slots=True)
class OutputAlone:
    """An output without a vehicle file: the parameter `channels` instead of `vehicle`."""

    channels: tuple[int, ...] = knob((0, 1, 2, 3, 4, 5, 6, 7), 0, 15, "output channels of the thrusters, in order [-]")
    output: Output = field(default_factory=Output)


def read_settings(arguments: Sequence[str]) -> Settings:
    """Read vehicle file and output port; UsageError names what is missing."""
    found: dict[str, object] = {}
    for values in _parameters(arguments, f"{namespace_of(arguments)}/{NODE}"):
        found |= values
    file = str(found.get("vehicle", ""))
    if not file and "channels" not in found:
        raise UsageError("thrusters: no vehicle file; give one with --ros-args -p vehicle:=FILE, or -p channels:=[0,1]")
    vehicle = load_vehicle(file) if file else _vehicle_of(found)
    port, clock = str(found.get("port", vehicle.output.port)), str(found.get("clock", "system"))
    names = {one.name for one in fields(OutputGuardKnobs)}
    knobs = build(OutputGuardKnobs, {name: value for name, value in found.items() if name in names}, NODE)
    return Settings(vehicle, port, clock, alone=not file, knobs=knobs, arguments=tuple(arguments))


def _vehicle_of(found: Mapping[str, object]) -> Vehicle:
    """A vehicle of which nothing is known but its output."""
    output = {name.removeprefix("output."): value for name, value in found.items() if name.startswith("output.")}
    alone = build(OutputAlone, {"channels": found["channels"], "output": output}, "thrusters")
    named = enumerate(alone.channels, 1)
    return replace(
        NO_VEHICLE,
        thrusters=tuple(Thruster(f"T{number}", (0.0, 0.0, 0.0), channel=channel) for number, channel in named),
        curves={"main": Curve(Branch((-150.0, 0.1, 0.0, 0.0), 1100.0, 1475.0))},
        output=alone.output,
    )


def namespace_of(arguments: Sequence[str]) -> str:
    """Namespace that ROS arguments give to the nodes of a process (`-r __ns:=/rov1`)."""
    rules = [value for word, value in pairwise(arguments) if word in ("-r", "--remap")]
    found = [rule.removeprefix("__ns:=") for rule in rules if rule.startswith("__ns:=")]
    return found[-1].rstrip("/") if found else NAMESPACE


def _parameters(arguments: Sequence[str], node: str) -> Iterator[Mapping[str, object]]:
    """Parameters of this node, source by source."""
    for word, value in pairwise(arguments):
        if word == "--params-file":
            yield from (block for pattern, block in parameter_blocks(value) if block and names_node(pattern, node))
        elif word in ("-p", "--param"):
            name, assigned, text = value.partition(":=")
            if assigned:
                yield {name.rpartition(":")[2]: yaml.safe_load(text)}
