"""Processes die or freeze, the vehicle does not: each in flight, and wires and the true pose are judged."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from hindrax_operator.nodes.operator_node import Operator

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.process_state import descendants, is_stopped
from hindrax_bringup.processes import modules
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, Stack, environment, own_domain
from hindrax_bringup.stack_lock import FOLDER
from hindrax_bringup.supervisor import Supervisor
from hindrax_core.bus_operations import WriteRead
from hindrax_core.events import seconds_between
from hindrax_core.signals import NAN
from hindrax_drivers.buses.ports import open_bus
from hindrax_operator.pool_run import adopted

pytestmark = pytest.mark.ros

LED0_OFF, CHANNEL_BYTES, THRUSTERS = 0x06, 4, 8
US_PER_COUNT = 1e6 * 31 / 25e6
"""PRE_SCALE 30 on the nominal oscillator (NXP PCA9685 rev. 4, section 7.3.5)."""
WORST_TILT_deg = 30.0
"""In none of these flights does the vehicle lean much, whatever its state says: by 21 to 23 where it loses its thrust
in the fastest surge, with which a plan begins."""
SERVICE = Path(__file__).parents[2] / "docker/pi/hindrax.service"
NEUTRAL_us, TOLERANCE_us = 1500.0, 2.0
NEW_PROCESS_s = 60.0
"""Where nobody is left who could write neutral a new process must start: how long that takes is the host's affair."""


class Wire:
    """An observer of the emulated PCA9685 who reads its registers, and knows the mock's time."""

    def __init__(self, port: str) -> None:
        self.port, self.bus = port, open_bus(port, "observer")

    def pulses(self) -> list[float]:
        data = self.bus.transfer(WriteRead(0x40, bytes([LED0_OFF]), CHANNEL_BYTES * THRUSTERS))
        counts = [
            int.from_bytes(data[at + 2 : at + 4], "little") - int.from_bytes(data[at : at + 2], "little")
            for at in range(0, len(data), CHANNEL_BYTES)
        ]
        return [count * US_PER_COUNT for count in counts]

    def neutral(self) -> bool:
        return all(abs(pulse - NEUTRAL_us) < TOLERANCE_us for pulse in self.pulses())

    def seconds_to_neutral(self, meanwhile: Callable[[], None] = lambda: None, at_most_wall_s: float = 30.0) -> float:
        begin, deadline = self.bus.now(), time.monotonic() + at_most_wall_s
        while not self.neutral():
            assert time.monotonic() < deadline, f"still at {self.pulses()}"
            meanwhile()
            time.sleep(0.002)
        return seconds_between(begin, self.bus.now())


@pytest.fixture(scope="module")
def flying(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Supervisor, Operator, Wire]]:
    """A mock vehicle that holds its depth under water, thrusters at work."""
    from hindrax_operator.nodes.operator_node import Operator

    folder = make_run_folder(str(tmp_path_factory.mktemp("deaths") / "run"), default_vehicle())
    with own_domain(mock=True) as domain:
        made = environment(mock=True, domain=domain)
        with Supervisor(folder.logs, made, preload=modules(mock=True)) as supervisor, adopted(made):
            stack = Stack(folder, supervisor)
            stack.start(MockOptions(seed=2, rate=2.0), record=False)
            with Operator(mock=True, tick=supervisor.check) as operator:
                operator.wait(lambda: operator.navigation is not None, 180.0, lambda: "navigation")
                ports = stack.mock_facts["ports"]
                yield supervisor, operator, Wire(ports["thrusters"])
                assert stack.last_facts()["worst_tilt_deg"] < WORST_TILT_deg


def dive(operator: Operator, wire: Wire) -> None:
    """Arm, and hold a depth; a control process that has just been started again navigates first."""
    from hindrax_operator.nodes.orders import hold

    since = operator.now()
    operator.wait(lambda: operator.navigation.stamp > since, 180.0, lambda: "navigation")
    operator.arm(seconds=180.0)
    for axis, value in (("depth", 0.8), ("heading", NAN), ("roll", 0.0), ("pitch", 0.0)):
        hold(operator, [axis], value, engaged=True)
    operator.wait(lambda: operator.navigation.reading.depth_m > 0.6, 180.0, lambda: "the vehicle to dive")
    assert not wire.neutral()


def child(supervisor: Supervisor, name: str) -> int:
    """The process that holds the nodes: for the thrusters that is the child of their dead man."""
    pid = supervisor.children[name].handle.pid
    if name != "thrusters":
        return pid
    return int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])


def test_the_vehicle_holds_on_without_its_identifier(flying: tuple[Supervisor, Operator, Wire]) -> None:
    supervisor, operator, wire = flying
    dive(operator, wire)
    os.kill(child(supervisor, "identifier"), signal.SIGKILL)
    since = operator.now()
    operator.wait(lambda: seconds_between(since, operator.now()) > 8.0, 180.0, lambda: "time to pass")
    assert operator.thrusters.armed
    assert operator.navigation.reading.depth_m == pytest.approx(0.8, abs=0.15)


@pytest.mark.parametrize("name", ["control", "thrusters"])
def test_neutral_within_half_a_second_of_a_death(flying: tuple[Supervisor, Operator, Wire], name: str) -> None:
    supervisor, operator, wire = flying
    if not operator.thrusters.armed:
        dive(operator, wire)
    operator.wait(lambda: not wire.neutral(), 180.0, lambda: "the thrusters to work")
    os.kill(child(supervisor, name), signal.SIGKILL)
    assert wire.seconds_to_neutral() < 0.5
    operator.wait(lambda: not operator.thrusters.armed, 180.0, lambda: "the thrusters to be disarmed")
    since = operator.now()
    operator.wait(lambda: seconds_between(since, operator.now()) > 2.0, 180.0, lambda: "time to pass")
    assert wire.neutral(), "it must not come back armed"


@pytest.mark.parametrize(
    ("who", "within_s"),
    [
        ("control", 2.0),
        ("sensors", 2.0),
        ("thrusters", 2.0),
        ("dead man", 2.0),
        ("thrusters and dead man", NEW_PROCESS_s),
    ],
)
def test_neutral_after_a_freeze(flying: tuple[Supervisor, Operator, Wire], who: str, within_s: float) -> None:
    supervisor, operator, wire = flying
    dive(operator, wire)
    operator.wait(lambda: not wire.neutral(), 180.0, lambda: "the thrusters to work")
    pids = [child(supervisor, name) for name in ("control", "sensors", "thrusters") if name in who]
    pids += [supervisor.children["thrusters"].handle.pid] if "dead man" in who else []
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    assert wire.seconds_to_neutral(supervisor.check) < within_s
    operator.wait(lambda: not any(map(is_stopped, pids)), 180.0, lambda: "the frozen ones to be killed")
    operator.wait(lambda: not operator.thrusters.armed, 180.0, lambda: "the thrusters to be disarmed")
    since = operator.now()
    operator.wait(lambda: seconds_between(since, operator.now()) > 2.0, 180.0, lambda: "time to pass")
    assert wire.neutral(), "it must not come back armed"


def test_what_systemd_runs_after_it_has_killed_everything_puts_neutral_on_the_wire(
    flying: tuple[Supervisor, Operator, Wire], tmp_path: Path
) -> None:
    supervisor, operator, wire = flying
    dive(operator, wire)
    operator.wait(lambda: not wire.neutral(), 180.0, lambda: "the thrusters to work")
    vehicle = [one.handle.pid for name, one in supervisor.children.items() if name != "mock"]
    killed = [*(pid for one in vehicle for pid in descendants(one)), *vehicle]
    for pid in killed:
        os.kill(pid, signal.SIGSTOP)
    for pid in killed:
        os.kill(pid, signal.SIGKILL)
    assert not wire.neutral(), "then nothing is to be shown"
    file = tmp_path / "vehicle.yaml"
    document = yaml.safe_load(default_vehicle().read_text())
    document["output"]["port"] = wire.port
    file.write_text(yaml.safe_dump(document))
    (line,) = [one for one in SERVICE.read_text().splitlines() if one.startswith("ExecStopPost=")]
    words = line.removeprefix("ExecStopPost=/opt/hindrax/hindrax ").split()
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_cli.command_line", *words, "--vehicle", file],
        env=os.environ | {FOLDER: str(tmp_path / "runtime")},
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout == "neutral is on the wire\n"
    assert wire.neutral()
    operator.wait(lambda: not operator.thrusters.armed, 180.0, lambda: "the thrusters to be disarmed")


def neutral_and_disarmed_after_the_sensors(operator: Operator, wire: Wire) -> None:
    """The sensors come back, the state begins anew, and nothing thrusts on it."""
    operator.wait(lambda: not operator.thrusters.armed, 180.0, lambda: "the thrusters to be disarmed")
    assert operator.thrusters.reason.startswith(("restart: ", "no command for "))
    since = operator.now()
    operator.wait(lambda: seconds_between(since, operator.navigation.stamp) > 3.0, 180.0, lambda: "navigation")
    assert wire.neutral(), "it must not come back armed"


def test_a_death_of_the_sensors_in_a_hold_ends_thrust(flying: tuple[Supervisor, Operator, Wire]) -> None:
    supervisor, operator, wire = flying
    if not operator.thrusters.armed:
        dive(operator, wire)
    operator.wait(lambda: not wire.neutral(), 180.0, lambda: "the thrusters to work")
    os.kill(child(supervisor, "sensors"), signal.SIGKILL)
    assert wire.seconds_to_neutral() < 0.5
    neutral_and_disarmed_after_the_sensors(operator, wire)


def test_a_death_of_the_sensors_in_a_maneuver_ends_it(flying: tuple[Supervisor, Operator, Wire]) -> None:
    supervisor, operator, wire = flying
    dive(operator, wire)
    neutral_s = []

    def kill() -> None:
        moving = operator.maneuver is not None and operator.maneuver.phase in ("transient", "plateau")
        if moving and not neutral_s:
            os.kill(child(supervisor, "sensors"), signal.SIGKILL)
            neutral_s.append(wire.seconds_to_neutral())

    with operator.repeating(0.1, kill):
        aborted = operator.fly(["surge"], excitation="plateaus", seed=1, on_cancel="hold", seconds=240.0)
    assert aborted
    assert neutral_s[0] < 0.5
    neutral_and_disarmed_after_the_sensors(operator, wire)
    dive(operator, wire)
