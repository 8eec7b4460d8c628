"""The thrusters process on a virtual bus, and a pilot for it. Real processes and real ROS.

The time of the bus goes at half the pace of the wall's, and stands still while a client works, so that a loaded machine
does not count as a slow vehicle.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from hindrax_bringup.stack import environment
from hindrax_core.events import Stamp, after, stamp_from_s, to_s
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.devices.pca9685 import pca9685_of
from hindrax_drivers.output.output_guard import guard_of
from hindrax_ros.testing.lifecycle_client import LifecycleClient
from hindrax_sim.buses.mock_server import BusServer
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.pca9685 import Pca9685

ROOT = Path(__file__).parents[1]
VEHICLE = ROOT / "src/hindrax_bringup/vehicles/hindrax.yaml"
SOURCES = [str(folder) for folder in sorted((ROOT / "src").glob("hindrax_*")) if folder.name != "hindrax_msgs"]
HINDRAX = load_vehicle(VEHICLE)
DRIVER = pca9685_of(HINDRAX, guard_of(HINDRAX).neutral.all_us)
NEUTRAL, MOVING = DRIVER.applied([1500.0] * 8), DRIVER.applied([1600.0] * 8)
STEP_S, PACE, PATIENCE_S = 0.005, 0.5, 0.02
PATIENT_S = 60.0


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
        self.tick: Callable[[], Any] = lambda: None
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node("pilot", namespace=NAMESPACE, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.states: list[Any] = []
        self.sequence, self.asked_at = 0, self.world.now
        self.last_at: Stamp | None = None
        self.commands = publisher(self.node, THRUSTER_COMMAND)
        subscription(self.node, THRUSTER_STATE, self.states.append)
        self.client = self.node.create_client(Arm, "thrusters/arm")
        self.lifecycle = LifecycleClient(self.node, "thrusters", self.until)
        self.node.create_timer(0.02 / PACE, self.speak)

    def speak(self) -> None:
        from hindrax_msgs.msg import ThrusterCommand
        from hindrax_ros.messages.convert import stamp_to_msg

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
            self.tick()
            self.executor.spin_once(timeout_sec=0.02)

    def run(self, seconds: float) -> None:
        end = after(self.world.now, seconds)
        self.until(lambda: self.world.now >= end, "time to pass")

    def arm(self, *, age_s: float = 0.0) -> Any:
        from hindrax_msgs.srv import Arm
        from hindrax_ros.messages.convert import stamp_to_msg

        self.until(self.client.service_is_ready, "the service thrusters/arm")
        # A second request within one step of the clock is not newer than the first.
        self.until(lambda: self.world.now > self.asked_at, "the clock to go on")
        self.sequence, self.asked_at = self.sequence + 1, self.world.now
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
    """World, process and pilot. `handle` tells the process that is the dead man at the moment."""

    def __init__(self, world: World, handle: Callable[[], subprocess.Popen[bytes]], domain: int | None) -> None:
        self.world, self._handle = world, handle
        self.pilot = Pilot(world, domain)

    @property
    def process(self) -> subprocess.Popen[bytes]:
        return self._handle()

    @property
    def dead_man(self) -> psutil.Process:
        return psutil.Process(self.process.pid)

    def child(self) -> psutil.Process:
        (found,) = self.dead_man.children()
        return found

    def take_off(self) -> psutil.Process:
        """Arm, if need be, and move; returns the process of the node."""
        self.pilot.speaking = True
        self.pilot.until(lambda: self.pilot.states, "the output")
        # Asked again: a busy machine may not have heard yet that what a test has stopped goes on.
        self.pilot.until(lambda: self.is_moving() or self.pilot.arm().accepted, "an output that arms")
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


def variables(domain: int | None) -> dict[str, str]:
    """Environment of the process."""
    made = environment(mock=True, domain=domain)
    return made | {"PYTHONPATH": os.pathsep.join([*SOURCES, made.get("PYTHONPATH", "")])}


def words_of(world: World) -> list[str]:
    """Arguments of a thrusters process on this bus."""
    return ["--ros-args", "-p", f"vehicle:={VEHICLE}", "-p", f"port:=mock:{world.path}", "-p", "arming_s:=0.5"]


def start(words: list[str], domain: int | None) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "hindrax_drivers.nodes.thrusters", *words]
    return subprocess.Popen(command, env=variables(domain), stdin=subprocess.DEVNULL, stderr=subprocess.PIPE)
