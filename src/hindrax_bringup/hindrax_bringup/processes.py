"""The processes of the stack, declared once for the tool's runner and the launch files.

Nodes are grouped by fault domain. The thruster output is always a process of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core import sensor_table


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
    last_resort: tuple[str, ...] = ()
    """Words with which it only leaves its output safe, for when it had to be killed; none where it has no output."""
    reports: bool = False
    """Whether its stderr is for the operator."""


SENSORS = Process(
    "sensors",
    "hindrax_drivers",
    "hindrax_drivers.nodes.sensors",
    "sensors",
    tuple(sensor.name for sensor in sensor_table.SENSORS),
    "reads every sensor of the vehicle file",
)
THRUSTERS = Process(
    "thrusters",
    "hindrax_drivers",
    "hindrax_drivers.nodes.thrusters",
    "thrusters",
    ("thrusters",),
    "output guard and pulses, watched by a dead man",
    last_resort=("--neutral",),
)
CONTROL = Process(
    "control",
    "hindrax_control",
    "hindrax_control.nodes.control",
    "control",
    ("navigator", "estimator_health", "pilot", "allocator"),
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
SAFETY_MONITOR = Process(
    "safety_monitor",
    "hindrax_bringup",
    "hindrax_bringup.nodes.safety_monitor",
    "safety_monitor",
    ("safety_monitor",),
    "operator link, thrusters out of use, health of the nodes",
    reports=True,
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

REPLAY = Process(
    "replay",
    "hindrax_sim",
    "hindrax_sim.nodes.replay",
    "replay",
    ("replay",),
    "recorded wires as hardware",
    restart=False,
)
ONBOARD: tuple[Process, ...] = (SENSORS, THRUSTERS, CONTROL, IDENTIFIER, SAFETY_MONITOR)
UNHEARD = ["-r", "pilot:maneuver/status:=replay/unheard/maneuver_status"]
"""Remaps for a replay: the identifier receives the recorded maneuver, not the pilot's."""
EVERY: tuple[Process, ...] = (*ONBOARD, RECORDER, MOCK, REPLAY)


def modules(*, mock: bool) -> list[str]:
    """Modules that a fork server imports, in the order of starts; the identifier's SciPy would burden all others."""
    return [process.module for process in (*((MOCK,) if mock else ()), RECORDER, SENSORS, CONTROL, SAFETY_MONITOR)]
