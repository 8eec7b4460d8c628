"""The thrusters process on a virtual bus: whatever dies, hangs or falls silent, neutral is on the wire in time.

Real processes and real ROS. The time of the bus goes at half the pace of the wall's, and stands still while a client
works, so that a loaded machine does not count as a slow vehicle.
"""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from hindrax_bringup.stack import environment, own_domain
from hindrax_core.events import Stamp, after, stamp_from_s, to_s
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.devices.pca9685 import pca9685_of
from hindrax_sim.buses.bus import VirtualI2c
from hindrax_sim.buses.server import BusServer
from hindrax_sim.devices.pca9685 import Pca9685

ROOT = Path(__file__).parents[2]
VEHICLE = ROOT / "src/hindrax_bringup/vehicles/hindrax.yaml"
SOURCES = [str(folder) for folder in sorted((ROOT / "src").glob("hindrax_*")) if folder.name != "hindrax_msgs"]
DRIVER = pca9685_of(load_vehicle(VEHICLE))
NEUTRAL, MOVING = DRIVER.applied([1500.0] * 8), DRIVER.applied([1600.0] * 8)
STEP_S, PACE, PATIENCE_S = 0.005, 0.5, 0.02
PROMISED_S = 0.5
PATIENT_S = 60.0

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]


class World(threading.Thread):
    """The bus, the chip on it, and the time of both."""

    def __init__(self, folder: Path) -> None:
        super().__init__(daemon=True)
        self.chip = Pca9685()
        self.now = stamp_from_s(100.0)
        self.path = str(folder / "i2c")
        wires = VirtualI2c()
        wires.attach(0x40, self.chip)
        self._server = BusServer(self.path, wires.transfer, self.now)
        self.stopping = threading.Event()

    def run(self) -> None:
        while not self.stopping.is_set():
            began = time.monotonic()
            self.now = after(self.now, STEP_S)
            self._server.serve(self.now, 0.0)
            while self._server.busy() and time.monotonic() < began + PATIENCE_S:
                self._server.serve(self.now, 0.002)
            while (left := began + STEP_S / PACE - time.monotonic()) > 0.0:
                self._server.serve(self.now, left)
        self._server.close()

    def wire(self) -> tuple[float | None, ...]:
        return self.chip.pulses_us()[:8]

    def last_moving_s(self) -> float:
        """Time at which the last pulses that were not neutral ended: the stamp of the change after them."""
        changes = list(self.chip.changes)
        for before, then in zip(reversed(changes[:-1]), reversed(changes[1:]), strict=True):
            if before.pulses_us[:8] != pytest.approx(NEUTRAL):
                return then.now_s
        raise AssertionError("it never moved")


class Pilot:
    """Commands at 50 Hz of the bus's time until told to be silent, and what comes back."""

    def __init__(self, world: World, domain: int | None) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from hindrax_core.topics import NAMESPACE, THRUSTER_COMMAND, THRUSTER_STATE
        from hindrax_msgs.srv import Arm
        from hindrax_ros.graph import publisher, subscription

        self.world, self.speaking = world, True
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node("pilot", namespace=NAMESPACE, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.states: list[Any] = []
        self.sequence = 0
        self.last_at: Stamp | None = None
        self.commands = publisher(self.node, THRUSTER_COMMAND)
        subscription(self.node, THRUSTER_STATE, self.states.append)
        self.client = self.node.create_client(Arm, "thrusters/arm")
        self.node.create_timer(0.02 / PACE, self.speak)

    def speak(self) -> None:
        from hindrax_msgs.msg import ThrusterCommand
        from hindrax_ros.convert import stamp_to_msg

        if self.speaking:
            self.sequence += 1
            self.last_at = self.world.now
            message = ThrusterCommand(sequence=self.sequence, pulses=[1600.0] * 8)
            message.header.stamp = stamp_to_msg(self.last_at)
            self.commands.publish(message)

    def until(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, f"waited for {what}; last state {self.states[-1:]}"
            self.executor.spin_once(timeout_sec=0.02)

    def run(self, seconds: float) -> None:
        end = after(self.world.now, seconds)
        self.until(lambda: self.world.now >= end, "time to pass")

    def arm(self, *, age_s: float = 0.0) -> Any:
        from hindrax_msgs.srv import Arm
        from hindrax_ros.convert import stamp_to_msg

        self.until(self.client.service_is_ready, "the service thrusters/arm")
        self.sequence += 1
        request = Arm.Request(arm=True, sequence=self.sequence)
        request.stamp = stamp_to_msg(after(self.world.now, -age_s))
        future = self.client.call_async(request)
        self.until(future.done, "an answer to arm")
        return future.result()

    def close(self) -> None:
        import rclpy

        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


class Flight:
    """World, process and pilot."""

    def __init__(self, folder: Path, domain: int | None) -> None:
        self.world = World(folder)
        self.world.start()
        self.process = start(
            ["-p", f"vehicle:={VEHICLE}", "-p", f"port:=mock:{self.world.path}", "-p", "arming_s:=0.5"], domain
        )
        self.dead_man = psutil.Process(self.process.pid)
        self.pilot = Pilot(self.world, domain)

    def child(self) -> psutil.Process:
        (found,) = self.dead_man.children()
        return found

    def take_off(self) -> psutil.Process:
        """Arm, if need be, and move; returns the process of the node."""
        self.pilot.speaking = True
        self.pilot.until(lambda: self.pilot.states, "the output")
        if not self.is_moving():
            answer = self.pilot.arm()
            assert answer.accepted, answer.reason
        self.pilot.until(self.is_moving, "pulses")
        return self.child()

    def is_moving(self) -> bool:
        return bool(self.world.wire() == pytest.approx(MOVING))

    def is_neutral(self) -> bool:
        return bool(self.world.wire() == pytest.approx(NEUTRAL))

    def neutral_after(self, begin: Stamp) -> float:
        """Wait for neutral, and that it stays; seconds of the bus's time that it took."""
        self.pilot.until(self.is_neutral, "neutral on the wire")
        self.pilot.run(0.3)
        assert self.is_neutral()
        return self.world.last_moving_s() - to_s(begin)

    def close(self) -> None:
        self.pilot.close()
        if self.process.poll() is None:
            for one in self.dead_man.children():
                one.kill()
            self.process.kill()
        self.process.wait()
        self.world.stopping.set()
        self.world.join()


def start(words: list[str], domain: int | None) -> subprocess.Popen[bytes]:
    variables = environment(mock=True, domain=domain)
    variables["PYTHONPATH"] = os.pathsep.join([*SOURCES, variables.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "hindrax_drivers.nodes.thrusters", "--ros-args", *words]
    return subprocess.Popen(command, env=variables, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE)


class Hangar:
    """Keeps one flight for many tests, because a process with ROS takes long to start; a new one when it has ended."""

    def __init__(self, folders: pytest.TempPathFactory, domain: int | None) -> None:
        self.folders, self.domain = folders, domain
        self.kept: Flight | None = None

    def flight(self) -> Flight:
        if self.kept is None or self.kept.process.poll() is not None:
            self.close()
            self.kept = Flight(self.folders.mktemp("flight"), self.domain)
        return self.kept

    def close(self) -> None:
        if self.kept is not None:
            self.kept.close()


@pytest.fixture(scope="module")
def hangar(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hangar]:
    with own_domain(mock=True) as domain:
        made = Hangar(tmp_path_factory, domain)
        yield made
        made.close()


@pytest.fixture
def flight(hangar: Hangar) -> Flight:
    return hangar.flight()


def test_an_old_request_does_not_arm(flight: Flight) -> None:
    flight.pilot.until(lambda: flight.pilot.states, "the output")
    answer = flight.pilot.arm(age_s=1.5)
    assert not answer.accepted
    assert "s old" in answer.reason
    flight.pilot.run(1.0)
    assert not flight.pilot.states[-1].armed


def test_a_node_that_hangs_is_neutral_in_time(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    node.suspend()
    assert flight.neutral_after(begin) <= PROMISED_S
    node.resume()


def test_silence_is_neutral_in_time_and_speech_moves_again(flight: Flight) -> None:
    flight.take_off()
    flight.pilot.speaking = False
    begin = flight.pilot.last_at
    assert begin is not None
    assert flight.neutral_after(begin) <= PROMISED_S
    flight.pilot.speaking = True
    flight.pilot.until(flight.is_moving, "pulses again")


def test_a_killed_node_is_neutral_in_time_and_comes_back_disarmed(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    node.kill()
    assert flight.neutral_after(begin) <= PROMISED_S
    seen = len(flight.pilot.states)
    flight.pilot.until(lambda: len(flight.pilot.states) > seen + 5, "the node to come back")
    assert flight.child().pid != node.pid
    assert not any(state.armed for state in flight.pilot.states[seen:])
    assert flight.is_neutral()
    flight.take_off()


def test_a_killed_dead_man_takes_the_node_along_and_leaves_neutral(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    flight.dead_man.kill()
    flight.process.wait()
    assert flight.neutral_after(begin) <= PROMISED_S
    flight.pilot.until(lambda: not node.is_running(), "the node to end")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_neutral_and_nobody_behind(flight: Flight, number: signal.Signals) -> None:
    node = flight.take_off()
    flight.dead_man.send_signal(number)
    assert flight.process.wait(PATIENT_S) == 0
    assert flight.is_neutral()
    assert not node.is_running()


def test_a_missing_vehicle_file_is_one_sentence_and_code_2() -> None:
    process = start(["-p", "vehicle:=/nowhere.yaml"], None)
    _, said = process.communicate(timeout=PATIENT_S)
    assert process.returncode == 2
    assert said.decode().startswith("thrusters: vehicle file /nowhere.yaml: cannot be read")
    assert len(said.splitlines()) == 1
