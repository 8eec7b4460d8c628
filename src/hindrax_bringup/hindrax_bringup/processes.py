"""The processes of the stack, declared once for the tool's runner and the launch files.

Nodes are grouped by fault domain. The thruster output is always a process of its own.
"""

from dataclasses import dataclass

from hindrax_core import sensor_table


@dataclass(frozen=True, slots=True)
class Process:
    """One operating system process: module to run, which is an executable in a ROS installation; its nodes."""

    module: str
    nodes: tuple[str, ...]
    restart: bool = True
    last_resort: tuple[str, ...] = ()
    """Words with which it only leaves its output safe, for when it had to be killed; none where it has no output."""
    reports: bool = False
    """Whether its stderr is for the operator."""

    @property
    def name(self) -> str:
        """Last part of the module."""
        return self.module.rpartition(".")[2]

    @property
    def package(self) -> str:
        """First part of the module."""
        return self.module.partition(".")[0]


SENSORS = Process("hindrax_drivers.nodes.sensors", tuple(sensor.name for sensor in sensor_table.SENSORS))
THRUSTERS = Process("hindrax_drivers.nodes.thrusters", ("thrusters",), last_resort=("--neutral",))
CONTROL = Process("hindrax_control.nodes.control", ("navigator", "estimator_health", "pilot", "allocator"))
IDENTIFIER = Process("hindrax_ident.nodes.identifier", ("identifier",))
SAFETY_MONITOR = Process("hindrax_bringup.nodes.safety_monitor", ("safety_monitor",), reports=True)
RECORDER = Process("hindrax_bag.nodes.recorder", ("recorder",))
MOCK = Process("hindrax_sim.nodes.mock", ("mock",), restart=False)
REPLAY = Process("hindrax_sim.nodes.replay", ("replay",), restart=False)

ONBOARD: tuple[Process, ...] = (SENSORS, THRUSTERS, CONTROL, SAFETY_MONITOR, IDENTIFIER)
"""In the order of starts: each is forked as soon as it is imported, the identifier with its SciPy last."""
REPLAYED: tuple[Process, ...] = (SENSORS, CONTROL, IDENTIFIER)
PILOT_STATUS_ASIDE = ["-r", "pilot:maneuver/status:=replay/unheard/maneuver_status"]
"""Remaps for a replay: the identifier receives the recorded maneuver, not the pilot's."""
EVERY: tuple[Process, ...] = (*ONBOARD, RECORDER, MOCK, REPLAY)
