"""The mock process: devices at ports, /clock on the graph, and at the end one line of ground truth."""

import argparse
import contextlib
import gc
import json
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Self

import rclpy
from rosgraph_msgs.msg import Clock

from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, to_s
from hindrax_core.topics import CLOCK, NAMESPACE
from hindrax_core.vehicle import Hydrodynamics, load_vehicle
from hindrax_ros.heartbeat import HeartbeatFile
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.process import StopSignal
from hindrax_ros.standstill import StandstillWatch
from hindrax_sim.conditions.known_coefficients import known_coefficients
from hindrax_sim.conditions.world_table import CONDITIONS, IDEAL, sizes_of
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.hardware import Hardware, STEP_ns
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.nodes.hardware_process import graph, main_of, outlast_output
from hindrax_sim.nodes.simulator_link import SimulatorLink
from hindrax_sim.physics.followed_plant import FollowedPlant
from hindrax_sim.physics.plant import Plant
from hindrax_sim.simulators import simulator_of
from hindrax_sim.world import Conditions

CLOCK_EVERY = 8
TURN_S = 0.002
"""Wall time for which a simulator's next state is awaited before the clients of the bus are served again."""


def parser() -> argparse.ArgumentParser:
    """Arguments of the process."""
    made = argparse.ArgumentParser(prog="mock", description="the mock vehicle")
    made.add_argument("--vehicle", required=True)
    made.add_argument("--seed", type=int, default=1)
    made.add_argument("--rate", type=float, default=0.0)
    made.add_argument("--no-wait", action="store_true", help="time waits for nobody who is late, and goes at --rate")
    made.add_argument("--fault", action="append", default=[])
    made.add_argument("--world", default=IDEAL)
    made.add_argument("--folder", help="where sockets and ptys lie; default a temporary folder")
    made.add_argument("--namespace", default=NAMESPACE, help="of the vehicle; its clock is there, or at /clock")
    made.add_argument("--truth", help="file for true states and pulses, a line per step")
    made.add_argument("--simulator", default="", help="another simulator moves the vehicle, over topics")
    made.add_argument("--no-ros", action="store_true", help="devices only, no /clock")
    return made


class ClockPublisher:
    """Publishes /clock at 25 Hz of the mock's time; a context manager."""

    def __init__(self, mock: MockVehicle, namespace: str) -> None:
        self._namespace, self._watch = namespace, StandstillWatch()
        self._place = contextlib.ExitStack()
        self._join()
        mock.after_step.append(self._show)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._watch.close()
        self._place.close()

    def _join(self) -> None:
        self._place.enter_context(graph(self._namespace))
        self.node = rclpy.create_node("mock", namespace=NAMESPACE, enable_rosout=False, start_parameter_services=False)
        self._place.callback(self.node.destroy_node)
        self._out = self.node.create_publisher(Clock, CLOCK, 1)

    def keep(self) -> bool:
        """Join the graph anew after a standstill, for which the vehicle cannot be restarted; whether that was so."""
        if not self._watch.stood_still_s():
            return False
        self._place.close()
        self._join()
        return True

    def _show(self, now: Stamp) -> None:
        if (now // STEP_ns) % CLOCK_EVERY == 0:
            self._out.publish(Clock(clock=stamp_to_msg(now)))


def run(words: argparse.Namespace, folder: Path) -> int:
    """Serve until a signal."""
    stop, heartbeat = StopSignal(), HeartbeatFile(os.environ)
    vehicle = load_vehicle(words.vehicle)
    faults = [parse_fault(fault, vehicle) for fault in words.fault]
    conditions = Conditions(sizes=sizes_of(words.world, words.seed))
    elsewhere = simulator_of(words.simulator, vehicle.name) if words.simulator else None
    moved_by = Plant if elsewhere is None else FollowedPlant
    built = vehicle if vehicle.hydrodynamics else replace(vehicle, hydrodynamics=Hydrodynamics((0.0,) * 6))
    hardware = Hardware(vehicle, words.seed, conditions, faults, None if elsewhere is None else built, plant=moved_by)
    with MockVehicle(hardware, folder, rate=words.rate, waits=not words.no_wait) as mock:
        with (
            Path(words.truth or os.devnull).open("w", buffering=1, encoding="ascii") as log,
            contextlib.nullcontext() if words.no_ros else ClockPublisher(mock, words.namespace) as clock,
        ):
            link = None
            if elsewhere is not None and clock is not None and isinstance(hardware.world.plant, FollowedPlant):
                link = SimulatorLink(clock.node, elsewhere, vehicle, hardware.world.plant)
                link.wait_for_first(lambda: stop.asked)
                mock.after_step.append(link.push)
            if words.truth:
                mock.after_step.append(lambda _now: log.write(mock.hardware.true_state().line()))
            known = known_coefficients(hardware.world.truth) if vehicle.hydrodynamics else {}
            facts = {"ports": mock.ports, "clock": mock.clock, "truth": known}
            print(json.dumps(facts), flush=True)  # noqa: T201  # for the parent
            gc.freeze()
            while not stop.asked:
                if link is None or link.may_step():
                    mock.step()
                else:  # its time stands, and so does that of the stack
                    mock.serve_clients(0.0)
                if link is not None:
                    link.serve(0.0 if link.may_step() else TURN_S)
                if clock is not None and clock.keep() and link is not None:
                    raise HindraxError("the computer stood still, and the simulator may have lost it; start both again")
                if link is not None:
                    link.require_going_on()
                heartbeat.beat(time.monotonic())
            outlast_output(mock)
            if link is not None:
                link.rest()
        print(json.dumps(ground_truth(mock)), flush=True)  # noqa: T201  # for the parent
    return 0


def ground_truth(mock: MockVehicle) -> dict[str, object]:
    """Ground truth of the run."""
    world = mock.hardware.world
    return {
        "world": dict(world.conditions.sizes),
        "world_units": {name: CONDITIONS[name].unit for name in world.conditions.sizes},
        "wall_hits": world.box.wall_hits,
        "worst_control_gap_s": mock.governor.worst_lag_s,
        "vehicle_s": to_s(mock.hardware.stamp),
    }


def main() -> int:
    """Run the mock in a folder of its own."""
    return main_of(parser(), run)


if __name__ == "__main__":
    sys.exit(main())
