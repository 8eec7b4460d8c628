"""The mock vehicle behind an ArduSub: output and sensors on one line, over a pty and the mock's clock."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import pytest

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, Stamped, seconds_between, stamp_from_s
from hindrax_core.readings import AppliedPulses, Inertial, Pressure, Reading
from hindrax_core.signals import AppliedOutput, Command
from hindrax_core.text.refusals import LEFT_ARMED
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_drivers.buses.clock import Clock
from hindrax_drivers.buses.line import Line, open_line
from hindrax_drivers.devices.ardupilot.output import ArduSub
from hindrax_drivers.devices.ardusub import ArduSub as Sensor
from hindrax_drivers.nodes.deadman import HUNG_S
from hindrax_drivers.output import output_ports
from hindrax_drivers.output.output_guard import OutputGuardKnobs, Pulses, Request, guard_of
from hindrax_drivers.output.output_host import OutputHost
from hindrax_drivers.output.output_ports import FOUND_WITHIN_S, SERIAL_TURN_S, LineOutput, Rider
from hindrax_sim.devices.ardupilot import firmware
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle

HEAVY = load_vehicle(Path(__file__).parents[2] / "src/hindrax_bringup/vehicles/bluerov2-heavy.yaml")
AHEAD = (1420.0, 1420.0, 1580.0, 1580.0, 1500.0, 1500.0, 1500.0, 1500.0)


def behind_ardusub() -> Vehicle:
    output = replace(HEAVY.output, device="ardusub", port="udpin:0.0.0.0:14550")
    return replace(HEAVY, output=output, sensors={"autopilot": Mount("ardusub")})


class Beside:
    """The mock's time for one that is stepped in the same thread."""

    def __init__(self, mock: MockVehicle) -> None:
        self._mock = mock

    def now(self) -> Stamp:
        return self._mock.hardware.stamp

    def sleep_until(self, *_words: object, **_more: object) -> None:
        self._mock.step()

    def wake(self) -> None:
        pass

    def close(self) -> None:
        pass


def test_one_line_carries_thrust_and_what_the_autopilot_measures(tmp_path: Path) -> None:
    vehicle = behind_ardusub()
    assert vehicle.on_output_line == ("autopilot",)
    readings: list[Reading] = []
    frames: dict[str, list[bytes]] = {"thrusters": [], "autopilot": []}

    def deliver(outputs: Iterable[Output]) -> None:
        readings.extend(one.reading for one in outputs if isinstance(one, Stamped))

    rider = Rider(Sensor(), deliver, lambda _stamp, _sent, data: frames["autopilot"].append(data))
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        assert list(mock.ports) == ["thrusters"]
        output = LineOutput(
            mock.ports["thrusters"],
            ArduSub(vehicle),
            Beside(mock),
            lambda _stamp, _sent, data: frames["thrusters"].append(data),
            [rider],
        )
        assert output.set_up(patient=True).startswith("ArduSub 4.5.1, system 1, driven by MANUAL_CONTROL")
        end = mock.hardware.stamp + stamp_from_s(5.0)
        while mock.hardware.stamp < end:
            output.write(Pulses(AHEAD, ()), armed=True)
            output.wait(Stamp(mock.hardware.stamp + 20_000_000))
            output.serve()
        assert mock.hardware.output.pulses_us()[:8] == AHEAD
        made = output.applied(Pulses(AHEAD, ()))[-1]
        assert made.reading.pulses_us == AHEAD
        assert made.stamp < mock.hardware.stamp, "when the autopilot had them, not now"
        assert mock.hardware.world.plant.u > 0.1
        kinds = [type(one) for one in readings]
        assert kinds.count(Inertial) > 380
        assert kinds.count(Pressure) > 55
        assert frames["autopilot"][0] == b"", "a replay restarts the driver there"
        received = [data for data in frames["thrusters"] if data[:1] == b"\xfd"]
        assert set(received[-20:]) & set(frames["autopilot"]), "each keeps what it has read"
        output.close()


class Told:
    """A listener that keeps reasons, pulses and troubles."""

    def __init__(self) -> None:
        self.reasons: list[str] = []
        self.pulses: list[tuple[Stamp, tuple[float, ...]]] = []
        self.troubles: list[str] = []

    def applied(self, applied: AppliedOutput) -> None:
        self.reasons.append(applied.reason)
        self.pulses.append((applied.stamp, applied.pulses_us))

    def troubled(self, text: str) -> None:
        self.troubles.append(text)

    def refused(self, *_: object) -> None: ...
    def found(self, _identity: str) -> None: ...
    def deliver(self, _outputs: object) -> None: ...
    def on_idle(self) -> None: ...


def lose_first(board: firmware.ArduSub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lose the first answer of the autopilot for each parameter."""
    asked: set[bytes] = set()
    send = board._send_parameter

    def answer(name: bytes, channel: Any) -> None:
        if name in asked:
            send(name, channel)
        asked.add(name)

    monkeypatch.setattr(board, "_send_parameter", answer)


def test_an_autopilot_that_answers_late_is_no_trouble_and_its_line_is_served_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle, told = behind_ardusub(), Told()
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        board = mock.hardware.output
        assert isinstance(board, firmware.ArduSub)
        lose_first(board, monkeypatch)
        monkeypatch.setattr(output_ports, "FOUND_WITHIN_S", 1.0)
        output = LineOutput(mock.ports["thrusters"], ArduSub(vehicle), Beside(mock), lambda *_: None)
        host = OutputHost(output, guard_of(vehicle, OutputGuardKnobs(arming_s=0.0)), told)
        begun = mock.hardware.stamp
        output.wait(host.turn())
        turns_s: list[float] = []
        while not host.ready and seconds_between(begun, mock.hardware.stamp) < 30.0:
            before = mock.hardware.stamp
            due = host.turn()
            turns_s.append(seconds_between(before, mock.hardware.stamp))
            output.wait(due)
        assert host.ready
        assert seconds_between(begun, mock.hardware.stamp) > 1.5
        assert told.troubles == []
        assert set(told.reasons[:-1]) == {"the output is not set up yet"}
        assert max(turns_s) < SERIAL_TURN_S, "who measures on the same line is heard meanwhile"
        assert host.arm(Request(mock.hardware.stamp, 1)).accepted
        host.end()


def test_a_line_that_breaks_before_the_autopilot_has_answered_all_is_opened_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle, told = behind_ardusub(), Told()
    opened: list[str] = []

    def opening(path: str, baud: int, clock: Clock) -> Line:
        opened.append(path)
        return open_line(path, baud, clock)

    monkeypatch.setattr(output_ports, "open_line", opening)
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        output = LineOutput(mock.ports["thrusters"], ArduSub(vehicle), Beside(mock), lambda *_: None)
        host = OutputHost(output, guard_of(vehicle), told)
        output.wait(host.turn())
        assert (host.ready, len(opened)) == (False, 1)
        host.broken("lost")
        told.reasons.clear()
        output.wait(host.turn())
        assert (host.ready, len(opened), told.reasons) == (False, 2, ["lost"])
        while not host.ready and mock.hardware.stamp < stamp_from_s(30.0):
            output.wait(host.turn())
        assert (host.ready, len(opened), told.troubles) == (True, 2, ["lost"])
        host.end()


class Heard(ArduSub):
    """Keeps what the autopilot reports."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self.reports: list[tuple[Stamp, tuple[float, ...]]] = []

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        outputs = list(super().feed(data, stamp))
        readings = [(one.stamp, one.reading) for one in outputs if isinstance(one, Stamped)]
        self.reports += [(stamp, one.pulses_us) for stamp, one in readings if isinstance(one, AppliedPulses)]
        return outputs


def test_of_a_computer_that_was_held_up_all_pulses_are_told_once_in_their_order_with_their_own_times(
    tmp_path: Path,
) -> None:
    vehicle, told = behind_ardusub(), Told()
    device = Heard(vehicle)
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        output = LineOutput(mock.ports["thrusters"], device, Beside(mock), lambda *_: None)
        host = OutputHost(output, guard_of(vehicle, OutputGuardKnobs(arming_s=0.0)), told)
        while not host.ready:
            output.wait(host.turn())
        assert host.arm(Request(mock.hardware.stamp, 1)).accepted
        for number in range(1, 160):
            way = 0.01 * (number % 20)
            pulses = tuple(1500.0 + way * (pulse - 1500.0) for pulse in AHEAD)
            host.command(Command(pulses, (), mock.hardware.stamp, number))
            end = mock.hardware.stamp + stamp_from_s(0.02)
            while mock.hardware.stamp < end:
                output.wait(min(host.turn(), Stamp(end)))
            if number % 40 == 0:
                held_until = mock.hardware.stamp + stamp_from_s(0.3)
                while mock.hardware.stamp < held_until:
                    mock.step()
        host.turn()
        told_once = list(dict.fromkeys(one for one in told.pulses if one in device.reports))
        first, last = told_once[0][0], told_once[-1][0]
        assert told_once == list(dict.fromkeys(one for one in device.reports if first <= one[0] <= last))
        assert len({pulses for _, pulses in told_once}) > 15
        stamps = [stamp for stamp, _ in told.pulses if stamp >= first]
        assert stamps == sorted(stamps)
        host.end()


def test_the_state_says_that_the_autopilot_is_still_armed_until_it_is_not(tmp_path: Path) -> None:
    vehicle, told = behind_ardusub(), Told()
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        board = mock.hardware.output
        assert isinstance(board, firmware.ArduSub)
        board.parameters |= {"FS_PILOT_INPUT": 1.0, "FS_PILOT_TIMEOUT": 1.0}
        output = LineOutput(mock.ports["thrusters"], ArduSub(vehicle), Beside(mock), lambda *_: None)
        guard = guard_of(vehicle, OutputGuardKnobs(arming_s=0.0, disarm_after_s=60.0))
        host = OutputHost(output, guard, told)

        def turn(seconds: float) -> None:
            end = mock.hardware.stamp + stamp_from_s(seconds)
            while mock.hardware.stamp < end:
                output.wait(min(host.turn(), Stamp(end)))

        turn(1.0)
        assert host.arm(Request(mock.hardware.stamp, 1)).accepted
        turn(0.5)
        assert board.armed
        silent_until = mock.hardware.stamp + stamp_from_s(1.5)
        while mock.hardware.stamp < silent_until:  # nobody serves the line
            mock.step()
        turn(0.1)
        assert told.reasons[-1].startswith("nothing was sent to the autopilot for")
        assert told.reasons[-1].endswith(f"; {LEFT_ARMED}")
        assert host.left_armed
        turn(1.5)
        assert not board.armed
        assert told.reasons[-1].startswith("nothing was sent to the autopilot for")
        assert LEFT_ARMED not in told.reasons[-1]
        host.end()


def test_an_autopilot_whose_line_is_gone_in_flight_is_armed_as_far_as_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle, told = behind_ardusub(), Told()
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        output = LineOutput(mock.ports["thrusters"], ArduSub(vehicle), Beside(mock), lambda *_: None)
        host = OutputHost(output, guard_of(vehicle, OutputGuardKnobs(arming_s=0.0, disarm_after_s=60.0)), told)

        def turn(seconds: float) -> None:
            end = mock.hardware.stamp + stamp_from_s(seconds)
            while mock.hardware.stamp < end:
                output.wait(min(host.turn(), Stamp(end)))

        def refuse(*_: object) -> NoReturn:
            raise DeviceError("cannot connect")

        turn(1.0)
        assert host.arm(Request(mock.hardware.stamp, 1)).accepted
        turn(0.5)
        monkeypatch.setattr(output_ports, "open_line", refuse)
        host.broken("lost")
        turn(1.5)
        assert told.reasons[-1] == f"cannot connect; {LEFT_ARMED}"
        host.end()


def test_an_autopilot_that_lacks_something_is_refused_at_once_and_not_waited_for(tmp_path: Path) -> None:
    """Whoever serves the output must beat for its dead man, which takes three seconds of silence for a hang."""
    with MockVehicle(Hardware(behind_ardusub(), 1), tmp_path, rate=0.0) as mock:
        board = mock.hardware.output
        assert isinstance(board, firmware.ArduSub)
        board.parameters["FRAME_CONFIG"] = 7.0
        output = LineOutput(mock.ports["thrusters"], ArduSub(behind_ardusub()), Beside(mock), lambda *_: None)
        begin = mock.hardware.stamp
        with pytest.raises(DeviceError, match="its FRAME_CONFIG is 7"):
            output.set_up(patient=True)
        assert seconds_between(begin, mock.hardware.stamp) < FOUND_WITHIN_S < HUNG_S
        output.close()
