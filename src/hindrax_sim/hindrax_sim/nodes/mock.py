"""The mock process: devices at ports, /clock on the graph, and at the end one line of ground truth."""

import argparse
import contextlib
import gc
import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import rclpy
from rosgraph_msgs.msg import Clock

from hindrax_core.events import Stamp, to_s
from hindrax_core.topics import CLOCK, NAMESPACE
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.assess.results import truth_of
from hindrax_ros.heartbeat import HeartbeatFile
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.process import StopSignal
from hindrax_sim.conditions.world_table import CONDITIONS, IDEAL, sizes_of
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.hardware import Hardware, STEP_ns
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.nodes.hardware_process import graph, main_of, outlast_output
from hindrax_sim.world import Conditions

CLOCK_EVERY = 8


def parser() -> argparse.ArgumentParser:
    """Arguments of the process."""
    made = argparse.ArgumentParser(prog="mock", description="the mock vehicle")
    made.add_argument("--vehicle", required=True)
    made.add_argument("--seed", type=int, default=1)
    made.add_argument("--rate", type=float, default=0.0)
    made.add_argument("--fault", action="append", default=[])
    made.add_argument("--world", default=IDEAL)
    made.add_argument("--folder", help="where sockets and ptys lie; default a temporary folder")
    made.add_argument("--namespace", default=NAMESPACE, help="of the vehicle; its clock is there, or at /clock")
    made.add_argument("--truth", help="file for true states and pulses, a line per step")
    made.add_argument("--no-ros", action="store_true", help="devices only, no /clock")
    return made


@contextlib.contextmanager
def clock_publisher(mock: MockVehicle, namespace: str) -> Iterator[None]:
    """Publish /clock at 25 Hz of the mock's time."""
    with graph(namespace):
        node = rclpy.create_node("mock", namespace=NAMESPACE, enable_rosout=False, start_parameter_services=False)
        out = node.create_publisher(Clock, CLOCK, 1)

        def show(now: Stamp) -> None:
            if (now // STEP_ns) % CLOCK_EVERY == 0:
                out.publish(Clock(clock=stamp_to_msg(now)))

        mock.after_step.append(show)
        try:
            yield
        finally:
            node.destroy_node()


def run(words: argparse.Namespace, folder: Path) -> int:
    """Serve until a signal."""
    stop, heartbeat = StopSignal(), HeartbeatFile(os.environ)
    vehicle = load_vehicle(words.vehicle)
    faults = [parse_fault(fault, vehicle) for fault in words.fault]
    conditions = Conditions(sizes=sizes_of(words.world, words.seed))
    with MockVehicle(Hardware(vehicle, words.seed, conditions, faults), folder, rate=words.rate) as mock:
        with (
            Path(words.truth or os.devnull).open("w", buffering=1, encoding="ascii") as log,
            contextlib.nullcontext() if words.no_ros else clock_publisher(mock, words.namespace),
        ):
            if words.truth:
                mock.after_step.append(lambda _now: log.write(mock.hardware.true_state().line()))
            facts = {"ports": mock.ports, "clock": mock.clock, "truth": truth_of(mock.hardware.world.truth.described())}
            print(json.dumps(facts), flush=True)  # noqa: T201  # for the parent
            gc.freeze()
            while not stop.asked:
                mock.step()
                heartbeat.beat(time.monotonic())
            outlast_output(mock)
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
