"""The output of forces without ROS: what it sends, what it refuses; and the process that stands by to send zeros."""

import io
import os
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_core.bus_operations import DeviceError
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp
from hindrax_core.thrust.curves import Branch, Curve
from hindrax_core.vehicle import Output, Thruster, Vehicle
from hindrax_drivers.nodes import zero_forces
from hindrax_drivers.nodes.deadman import NeutralWriter, write_neutral
from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_drivers.output.force_output import ForceOutput, topics_of
from hindrax_drivers.output.output_guard import guard_of

LINE = Curve(
    Branch((-150.0, 0.1, 0.0, 0.0), 1100.0, 1500.0),
    Branch((-225.0, 0.15, 0.0, 0.0), 1500.0, 1900.0),
    dead_band_us=0.0,
    supply_exponent=0.0,
)
PORT = "/{name}_controller/reference"
THRUSTERS = (Thruster("port", (0.0, -0.2, 0.0)), Thruster("starboard", (0.0, 0.2, 0.0), channel=1, reversed=True))
VEHICLE = Vehicle(
    "two",
    10.0,
    0.01,
    (0.5, 0.5, 0.3),
    THRUSTERS,
    {"main": LINE},
    output=Output("ros2_control", PORT, light_channels=()),
)


class Topics:
    """Keeps what is sent."""

    def __init__(self) -> None:
        self.sent: list[list[float]] = []
        self.missing = ""

    def send(self, forces_N: Sequence[float]) -> None:
        self.sent.append(list(forces_N))

    def unheard(self) -> str:
        return self.missing


def output(vehicle: Vehicle = VEHICLE) -> tuple[ForceOutput, Topics]:
    clock: Any = SimpleNamespace(now=lambda: Stamp(1), wake=lambda: None)
    topics = Topics()
    return ForceOutput(vehicle, topics, clock), topics


def test_an_armed_pulse_is_the_force_of_its_curve_also_of_a_thruster_that_turns_the_other_way() -> None:
    made, topics = output()
    made.write(replace(guard_of(VEHICLE).neutral, thrusters=(1600.0, 1600.0)), armed=True)
    made.write(replace(guard_of(VEHICLE).neutral, thrusters=(1500.0, 1300.0)), armed=True)
    assert topics.sent == [pytest.approx([15.0, -10.0]), pytest.approx([0.0, 30.0])]


def test_whatever_the_pulses_are_nothing_is_sent_but_zeros_while_disarmed() -> None:
    made, topics = output()
    pulses = replace(guard_of(VEHICLE).neutral, thrusters=(1900.0, 1100.0))
    made.set_up()
    made.write(pulses, armed=False)
    made.shut_off()
    assert topics.sent == [[0.0, 0.0]] * 3


def test_an_output_that_nobody_hears_is_not_there() -> None:
    made, topics = output()
    topics.missing = "/port_controller/reference"
    with pytest.raises(DeviceError, match="/port_controller/reference: found no subscriber, wanted the controller"):
        made.set_up()
    assert topics.sent == [[0.0, 0.0]], "zeros first"
    with pytest.raises(DeviceError):
        made.check(guard_of(VEHICLE).neutral)


def test_a_curve_that_the_supply_changes_is_refused() -> None:
    with pytest.raises(
        UsageError, match=r"curves\.main: found thrust that changes with the supply, wanted supply_expo"
    ):
        output(replace(VEHICLE, curves={"main": replace(LINE, supply_exponent=1.2)}))


def test_the_port_is_one_topic_or_one_for_each_thruster() -> None:
    assert topics_of(VEHICLE, PORT) == ["/port_controller/reference", "/starboard_controller/reference"]
    assert topics_of(VEHICLE, "/thruster_controllers/commands") == ["/thruster_controllers/commands"]
    with pytest.raises(
        UsageError, match=r"output\.port: found '/dev/i2c-1' with device ros2_control, wanted a topic such"
    ):
        topics_of(VEHICLE, "/dev/i2c-1")


class Process:
    """In the place of the process that stands by: its input, and its end."""

    made: list["Process"] = []  # noqa: RUF012  # of one test

    def __init__(self, words: list[str], **_: Any) -> None:
        self.words, self.code, self.stdin = words, None if not Process.made else 0, io.BytesIO()
        self.stdin.fileno = lambda: 7  # type: ignore[method-assign]
        Process.made.append(self)

    def poll(self) -> int | None:
        return self.code

    def wait(self, _timeout_s: float = 0.0) -> int:
        return 1


def test_the_dead_man_has_zeros_sent_and_says_when_nobody_heard_them(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Process, "made", [])
    written: list[bytes] = []
    system = SimpleNamespace(set_blocking=lambda *_: None, write=lambda _file, data: written.append(data))
    monkeypatch.setattr(zero_forces, "os", system)
    monkeypatch.setattr(zero_forces, "subprocess", SimpleNamespace(Popen=Process, PIPE=-1, TimeoutExpired=TimeoutError))
    settings = Settings(VEHICLE, PORT, arguments=("--ros-args", "-r", "__ns:=/rov1"))
    writer = NeutralWriter(settings)
    writer.write()
    writer.write()
    assert written == [b"0", b"0"]
    assert len(Process.made) == 1, "it stands by"
    assert Process.made[0].words[2:] == ["hindrax_drivers.nodes.zero_forces", "--ros-args", "-r", "__ns:=/rov1"]
    Process.made[0].code = -9
    writer.write()
    assert len(Process.made) == 2, "and is started again when it was killed"
    writer.close()
    assert writer.trouble == "nobody listens to the forces"
    assert write_neutral(settings) == 1
    assert not capfd.readouterr().out


def test_what_stands_by_begins_anew_after_a_standstill_and_loses_no_zeros() -> None:
    """The middleware may have lost who listens; the pipe has what came meanwhile."""
    source, sink = os.pipe()
    sent: list[bool] = []
    standstills = iter([0.0, 8.0])
    try:
        os.write(sink, b"0")
        assert zero_forces.stands_by(source, lambda: next(standstills), lambda: sent.append(True)), "begin anew"
        assert len(sent) == 1
        os.write(sink, b"0")
        os.close(sink)
        assert not zero_forces.stands_by(source, lambda: 0.0, lambda: sent.append(True)), "the input has ended"
        assert len(sent) == 2
    finally:
        os.close(source)
