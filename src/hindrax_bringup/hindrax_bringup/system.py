"""The processes of the stack, once: the tool's own runner and the launch files both read this description.

Nodes are grouped by fault domain. The thruster output is always a process of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core import devices


@dataclass(frozen=True, slots=True)
class Process:
    """One operating system process: module to run, executable of the same code in a ROS installation, its nodes."""

    name: str
    package: str
    module: str
    executable: str
    nodes: tuple[str, ...]
    meaning: str
    restart: bool = True


SENSORS = Process(
    "sensors",
    "hindrax_drivers",
    "hindrax_drivers.nodes.sensors",
    "sensors",
    tuple(sensor.name for sensor in devices.SENSORS),
    "reads every sensor of the vehicle file",
)
THRUSTERS = Process(
    "thrusters",
    "hindrax_drivers",
    "hindrax_drivers.nodes.thrusters",
    "thrusters",
    ("thrusters",),
    "arming guard and pulses, watched by a dead man",
)
CONTROL = Process(
    "control",
    "hindrax_control",
    "hindrax_control.nodes.control",
    "control",
    ("navigator", "pilot", "allocator"),
    "state estimate, holds and maneuvers, allocation",
)
IDENTIFIER = Process(
    "identifier",
    "hindrax_ident",
    "hindrax_ident.nodes.identifier",
    "identifier",
    ("identifier",),
    "online identification",
)
RECORDER = Process(
    "recorder",
    "hindrax_bag",
    "hindrax_bag.nodes.recorder",
    "recorder",
    ("recorder",),
    "writes the bag",
)
MOCK = Process(
    "mock",
    "hindrax_sim",
    "hindrax_sim.nodes.mock",
    "mock",
    ("mock",),
    "the mock vehicle: plant, pool, devices, clock",
    restart=False,
)

ONBOARD: tuple[Process, ...] = (SENSORS, THRUSTERS, CONTROL, IDENTIFIER)
