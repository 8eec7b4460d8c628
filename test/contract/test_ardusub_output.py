"""The ArduSub output behind no guard, against the emulated firmware: no port, no thread, 5 ms a step."""

import random
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_control.allocation.allocation_cycle import AllocationCycle
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.driver_interface import Output, Send, Trouble
from hindrax_core.events import Stamp, Stamped, stamp_from_s, to_s
from hindrax_core.readings import AppliedPulses, DeviceText, vec6
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.devices.ardupilot.output import ArduSub
from hindrax_sim.devices.ardupilot import firmware
from hindrax_sim.devices.ardupilot.wire import Receiver, frame
from hindrax_sim.faults.fault_registry import FaultSpec, with_faults

BOX = Path(__file__).parents[2] / "src/hindrax_bringup/vehicles"
HEAVY, STANDARD = load_vehicle(BOX / "bluerov2-heavy.yaml"), load_vehicle(BOX / "bluerov2.yaml")
STEP_S = 0.005
BODY = "base_link_fsd"
NEUTRAL = (1500.0,) * 8


class Bench:
    """Driver and firmware on one wire; `pulses` are handed over fifty times a second while `alive`."""

    def __init__(
        self,
        vehicle: Vehicle = HEAVY,
        control: str = "manual_control",
        fault: str = "",
        lasts_s: float = 5.0,
        *,
        left_armed: bool = False,
        loss: float = 0.0,
        seed: int = 1,
    ) -> None:
        self.loss, self.random = loss, random.Random(seed)
        self.board = firmware.ArduSub(vehicle.thrusters, now_s=10.0)
        specs = [FaultSpec(fault, ("thrusters",), 5.0, lasts_s)] if fault else []
        self.link = with_faults("thrusters", self.board, specs, 1, 10.0)
        output = replace(vehicle.output, device="ardusub", control=control)
        self.device = ArduSub(replace(vehicle, output=output), left_armed=left_armed)
        self.now: Stamp = stamp_from_s(10.0)
        self.pulses: tuple[float, ...] = (1500.0,) * len(vehicle.thrusters)
        self.armed, self.alive = False, True
        self.outputs: list[Output] = []
        self.to_board, self.sent, self.turn = b"", b"", 0
        self.on_wire: dict[Stamp, tuple[float, ...]] = {}
        """What the thrusters got, by time."""
        self.take(self.device.start(self.now))

    def take(self, outputs: Iterable[Output]) -> None:
        for one in outputs:
            if isinstance(one, Send):
                self.to_board += self.lossy(one.data)
            else:
                self.outputs.append(one)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now = Stamp(self.now + stamp_from_s(STEP_S))
            sent, self.to_board = self.to_board, b""
            self.sent += sent
            data = self.lossy(self.link.receive(sent, to_s(self.now)) + self.link.step(to_s(self.now)))
            self.on_wire[self.now] = self.wire()
            self.turn += 1
            if not self.alive:
                continue
            self.take(self.device.feed(data, self.now))
            self.take(self.device.tick(self.now))
            if self.turn % 4 == 0:
                self.take(self.device.drive(self.pulses, (), self.now, armed=self.armed))

    def lossy(self, data: bytes) -> bytes:
        """What arrives: all of it, or nothing."""
        return b"" if self.random.random() < self.loss else data

    def fly(self, *pulses_us: float) -> None:
        """Set up, armed, at some pulses."""
        self.run(3.0)
        assert self.device.ready, self.device.trouble
        self.armed = True
        self.run(0.5)
        assert self.board.armed, self.texts()
        self.pulses = pulses_us
        self.run(0.5)

    def stranger(self, number: int, *values: float | bytes) -> None:
        """A frame of another ground station with the number that the autopilot obeys."""
        self.board.receive(frame(number, values, 0, 255, 190), to_s(self.now))

    def wire(self) -> tuple[float, ...]:
        return tuple(pulse or 0.0 for pulse in self.board.pulses_us()[: len(self.pulses)])

    def applied(self) -> tuple[float, ...]:
        return self.reports()[-1][1]

    def reports(self) -> list[tuple[Stamp, tuple[float, ...]]]:
        """Reported pulses with their stamps."""
        readings = [(one.stamp, one.reading) for one in self.outputs if isinstance(one, Stamped)]
        return [(stamp, one.pulses_us) for stamp, one in readings if isinstance(one, AppliedPulses)]

    def swing(self, seconds: float) -> None:
        """Drive two commands in turn, each for a tenth of a second."""
        for turn in range(round(10.0 * seconds)):
            self.pulses = AHEAD if turn % 2 else ALL_AXES
            self.run(0.1)

    def texts(self) -> list[str]:
        return [one.text for one in self.outputs if isinstance(one, Trouble)]


AHEAD = (1420.0, 1420.0, 1580.0, 1580.0, 1500.0, 1500.0, 1500.0, 1500.0)
ALL_AXES = (1440.0, 1480.0, 1550.0, 1530.0, 1560.0, 1480.0, 1540.0, 1460.0)
"""In the range of the mixer: no pair of thrusters works against another."""


@pytest.mark.parametrize("control", ["manual_control", "motor_test"])
@pytest.mark.parametrize("pulses", [AHEAD, ALL_AXES])
def test_the_pulses_that_were_asked_for_are_output_and_reported(control: str, pulses: tuple[float, ...]) -> None:
    bench = Bench(control=control)
    bench.fly(*pulses)
    bench.run(1.0)
    assert bench.wire() == pytest.approx(pulses, abs=3.0)
    assert bench.applied() == bench.wire()
    assert bench.texts() == []
    bench.armed = False
    bench.run(0.1)
    assert bench.wire() == NEUTRAL
    assert not bench.board.armed
    assert bench.device.fault() == ""


def test_the_gain_of_the_pilot_is_known_and_nothing_is_asked_for_that_cannot_be_scheduled() -> None:
    bench = Bench()
    bench.run(2.0)
    bench.board.gain = 0.25  # a button of the joystick at another ground station
    bench.fly(*AHEAD)
    assert bench.wire() == pytest.approx(AHEAD, abs=3.0)
    told = [
        one.reading.text for one in bench.outputs if isinstance(one, Stamped) and isinstance(one.reading, DeviceText)
    ]
    assert not [one for one in told if "No ap_message" in one], "an operator at QGroundControl reads it too"


def unlike_the_wire(bench: Bench, stamp: Stamp, pulses: tuple[float, ...]) -> bool:
    """Whether the thrusters did not get these pulses within 10 ms of a stamp, as near as a link can tell."""
    near = [wire for at, wire in bench.on_wire.items() if abs(at - stamp) <= stamp_from_s(0.01)]
    return pulses not in near


@pytest.mark.parametrize("held", ["", "merged"])
def test_reported_pulses_have_the_time_at_which_the_autopilot_made_them(held: str) -> None:
    """Whenever the link delivers: `merged` holds everything for up to a quarter of a second."""
    bench = Bench(fault=held, lasts_s=60.0)
    bench.fly(*AHEAD)
    bench.run(6.0)
    bench.outputs.clear()
    bench.swing(4.0)
    reports = bench.reports()
    assert len(reports) > 180
    assert not [stamp for stamp, pulses in reports if unlike_the_wire(bench, stamp, pulses)]
    stamps = [stamp for stamp, _ in reports]
    assert stamps == sorted(stamps)


@pytest.mark.parametrize("leap_s", [-1000.0, -0.2, 0.2, 1000.0, 2.0**32 * 1e-6 - 30.0])
def test_pulses_never_look_later_than_their_arrival_whatever_the_autopilot_s_clock_does(leap_s: float) -> None:
    """A restart ends the flight; a leap ahead, and the overflow of the 32 bits, do not."""
    bench = Bench(fault="merged", lasts_s=60.0)
    bench.fly(*AHEAD)
    bench.board.jump_clock(leap_s)
    for _ in range(60):
        before = len(bench.reports())
        bench.run(0.5)
        assert all(stamp <= bench.now for stamp, _ in bench.reports()[before:])
    stamp, pulses = bench.reports()[-1]
    assert not unlike_the_wire(bench, stamp, pulses)
    assert (bench.device.fault() == "") is (leap_s > -1.0)


def wrench(vehicle: Vehicle, pulses: tuple[float, ...]) -> tuple[float, ...]:
    applied = AppliedWrench(vehicle)
    return applied.wrench(applied.forces_N(pulses))


@pytest.mark.parametrize("axis", range(6))
def test_a_small_wrench_gets_through_the_mixer_although_each_thruster_has_a_dead_band(axis: int) -> None:
    wanted = vec6((1.5 if at == axis else 0.4) * arm for at, arm in enumerate((1.0, 1.0, 1.0, 0.2, 0.15, 0.2)))
    command = AllocationCycle(HEAVY).command(wanted, BODY, Stamp(1), Stamp(1))
    assert command is not None
    bench = Bench()
    bench.fly(*command.pulses_us)
    asked, found = wrench(HEAVY, command.pulses_us), wrench(HEAVY, bench.wire())
    # A thruster that runs at all gives 0.4 N: less of it cannot be had.
    assert found == pytest.approx(asked, abs=0.3)


@pytest.mark.parametrize("control", ["manual_control", "motor_test"])
def test_silence_of_this_computer_ends_at_neutral_and_disarmed(control: str) -> None:
    """The autopilot's own dead man: 0.5 s of motor tests, FS_PILOT_TIMEOUT of sticks."""
    bench = Bench(control=control)
    bench.fly(*AHEAD)
    bench.alive = False
    bench.run(0.6 if control == "motor_test" else 3.1)
    assert bench.wire() == NEUTRAL
    assert not bench.board.armed


def without_failsafes(bench: Bench) -> None:
    """It goes neutral without sticks, but stays armed: FS_PILOT_INPUT 1, and another ground station that beats."""
    bench.board.parameters |= {"FS_PILOT_INPUT": 1.0, "FS_GCS_ENABLE": 0.0}


def orders(bench: Bench) -> list[tuple[int, float]]:
    """Sticks, motor tests and armings that were sent: number of the message or command, first parameter."""
    found: list[tuple[int, float]] = []
    for one in Receiver().feed(bench.sent):
        if one.number == 69:
            found.append((69, float(one.values[:4] != (0, 0, 500, 0))))
        elif one.number == 76 and one.values[7] in (209, 400):
            found.append((int(one.values[7]), one.values[0]))
    return found


@pytest.mark.parametrize("control", ["manual_control", "motor_test"])
def test_a_silence_of_our_own_is_no_other_party_and_what_it_leaves_armed_is_disarmed(control: str) -> None:
    """As after a freeze of this computer: the autopilot alone has gone neutral."""
    bench = Bench(control=control)
    without_failsafes(bench)
    bench.fly(*AHEAD)
    bench.alive = False
    bench.run(10.0)
    assert bench.wire() == NEUTRAL
    assert bench.board.armed is (control == "manual_control")
    bench.alive, bench.sent = True, b""
    bench.run(0.02)
    assert bench.device.fault().startswith("nothing was sent to the autopilot for 10.")
    assert bench.device.left_armed
    bench.run(1.5)
    assert not bench.board.armed
    assert not bench.device.left_armed
    assert bench.texts()[-1] == "ardusub: the autopilot is disarmed again"
    assert set(orders(bench)) <= {(69, 0.0), (400, 0.0)}, "neutral, and disarm"


def hold_stick(bench: Bench) -> None:
    bench.stranger(69, 0, 800, 500, 0, 0, 1, 0, 0, 0, 0, *(0,) * 6)


def choose_stabilize(bench: Bench) -> None:
    bench.stranger(76, 1.0, float(firmware.STABILIZE), *(0.0,) * 5, 176, 1, 1, 0)


@pytest.mark.parametrize(("act", "seen"), [(hold_stick, "its sticks are not neutral"), (choose_stabilize, "STABILIZE")])
def test_who_has_taken_over_while_we_were_silent_keeps_the_vehicle(act: Callable[[Bench], None], seen: str) -> None:
    bench = Bench()
    without_failsafes(bench)
    bench.fly(*AHEAD)
    bench.alive = False
    bench.run(5.0)
    for turn in range(30):
        bench.alive = turn > 5
        act(bench)
        bench.run(0.1)
    assert bench.texts()[-1] == f"ardusub: another party has taken over meanwhile: {seen}; it is not disarmed"
    assert bench.board.armed
    assert not bench.device.left_armed


@pytest.mark.parametrize("reopened", [False, True])
def test_what_a_lost_link_leaves_armed_is_disarmed_when_it_answers_again(reopened: bool) -> None:
    bench = Bench(fault="absent", lasts_s=4.0)
    without_failsafes(bench)
    bench.fly(*AHEAD)
    bench.run(3.0)
    assert bench.device.fault().startswith("the autopilot has fallen silent")
    bench.armed = False
    if reopened:
        bench.take(bench.device.start(bench.now))
    bench.run(1.0)
    assert bench.device.left_armed
    assert bench.board.armed
    bench.run(4.0)
    assert not bench.board.armed
    assert not bench.device.left_armed


@pytest.mark.parametrize("left_armed", [False, True])
def test_only_what_the_process_before_has_left_armed_is_disarmed_at_the_start(left_armed: bool) -> None:
    bench = Bench(left_armed=left_armed)
    without_failsafes(bench)
    bench.stranger(76, 1.0, *(0.0,) * 6, 400, 1, 1, 0)
    bench.run(4.0)
    assert bench.device.ready
    assert bench.board.armed is not left_armed


def seldom_seen_stick(bench: Bench) -> None:
    """One whose messages most often come just before one of ours: two or three looks in a second show it."""
    for _ in range(8):
        bench.stranger(69, 0, 800, 500, 0, 0, 1, 0, 0, 0, 0, *(0,) * 6)
        bench.run(0.395)


def stick(bench: Bench) -> None:
    """A pilot holds the stick to starboard, as QGroundControl sends it, some 22 times a second."""
    for _ in range(25):
        bench.stranger(69, 0, 800, 500, 0, 0, 1, 0, 0, 0, 0, *(0,) * 6)
        bench.run(0.045)


def change_mode(bench: Bench) -> None:
    bench.stranger(76, 1.0, float(firmware.STABILIZE), *(0.0,) * 5, 176, 1, 1, 0)
    bench.run(1.2)


def disarm(bench: Bench) -> None:
    bench.stranger(76, 0.0, *(0.0,) * 6, 400, 1, 1, 0)
    bench.run(1.2)


def rearm(bench: Bench) -> None:
    """Between two heartbeats."""
    for arm in (0.0, 1.0):
        bench.stranger(76, arm, *(0.0,) * 6, 400, 1, 1, 0)
        bench.run(0.4)
    assert bench.wire() == NEUTRAL, "not moved by sticks of before"
    bench.run(0.4)


def restart(bench: Bench) -> None:
    bench.board.power_cycle(to_s(bench.now))
    bench.run(3.5)


def leak(bench: Bench) -> None:
    bench.board.parameters["FS_LEAK_ENABLE"] = 2.0
    bench.board.set_truth(firmware.AutopilotTruth(wet=True), to_s(bench.now))
    bench.run(1.2)


@pytest.mark.parametrize(
    ("act", "why"),
    [
        (stick, "another party has taken over: stick"),
        (seldom_seen_stick, "another party has taken over: stick"),
        (change_mode, "another party, or a failsafe, has taken over: STABILIZE"),
        (disarm, "the autopilot has been disarmed"),
        (rearm, "another party has taken over: it has disarmed and armed it"),
        (leak, "another party, or a failsafe, has taken over: SURFACE (Leak Detected)"),
        (restart, "the autopilot has restarted"),
    ],
)
def test_who_takes_over_ends_the_flight_by_name_and_it_is_not_resumed(act: Callable[[Bench], None], why: str) -> None:
    bench = Bench()
    bench.fly(*AHEAD)
    act(bench)
    assert bench.device.fault().startswith(why)
    bench.run(0.1)
    bench.sent = b""
    bench.run(2.0)
    assert not any(one.number in (69, 400, 209) for one in Receiver().feed(bench.sent)), "it is theirs"
    bench.armed = False
    bench.run(0.5)
    assert not any(one.number == 76 and one.values[7] == 400 for one in Receiver().feed(bench.sent)), "no disarm either"


@pytest.mark.parametrize(
    ("act", "whys"),
    [
        (change_mode, ("another party, or a failsafe, has taken over: STABILIZE",)),
        (disarm, ("the autopilot has been disarmed",)),
        (rearm, ("the autopilot has been disarmed", "another party has taken over")),  # a test ends before a heartbeat
        (restart, ("the autopilot has restarted",)),
    ],
)
def test_who_takes_over_motor_tests_ends_them_by_name(act: Callable[[Bench], None], whys: tuple[str, ...]) -> None:
    bench = Bench(control="motor_test")
    bench.fly(*AHEAD)
    act(bench)
    assert bench.device.fault().startswith(whys)
    bench.run(0.6)
    bench.sent = b""
    bench.run(2.0)
    assert not any(one.number in (69, 400, 209) for one in Receiver().feed(bench.sent)), "it is theirs"
    assert bench.wire() == NEUTRAL


@pytest.mark.parametrize("phase_s", [0.0, 0.25, 0.5, 0.75])
def test_no_motor_test_prolongs_the_thrust_of_whom_another_party_has_disarmed(phase_s: float) -> None:
    """The autopilot keeps the last pulses until no test has come for half a second; those that it refuses count."""
    bench = Bench(control="motor_test")
    bench.fly(*AHEAD)
    bench.run(phase_s)  # whenever the next heartbeat comes
    bench.stranger(76, 0.0, *(0.0,) * 6, 400, 1, 1, 0)
    bench.run(0.75)
    assert bench.wire() == NEUTRAL


def test_a_station_on_the_same_line_that_starts_leaves_us_the_rates_that_we_need() -> None:
    """QGroundControl behind the router asks for its own rates, 2 Hz for the pulses: the autopilot has one a line."""
    bench = Bench()
    bench.fly(*AHEAD)
    wanted = dict(bench.board.channels[0].intervals_s)
    for number in wanted:
        bench.stranger(76, float(number), 0.5e6, *(0.0,) * 5, 511, 1, 1, 0)
    assert bench.board.channels[0].intervals_s == dict.fromkeys(wanted, 0.5)
    bench.run(4.0)
    assert bench.board.channels[0].intervals_s == wanted
    assert bench.device.fault() == ""


def test_a_parameter_that_is_changed_in_flight_ends_it_and_the_autopilot_is_judged_anew() -> None:
    """A pilot turns a motor round at the other station: our sticks would push it the other way from then on."""
    bench = Bench()
    bench.fly(*AHEAD)
    name, sense = "MOT_5_DIRECTION", bench.board.parameters["MOT_5_DIRECTION"]
    bench.stranger(23, -sense, 1, 1, name.encode(), 9)
    bench.run(2.0)
    assert bench.device.fault() == f"another party has changed its {name}"
    assert not bench.board.armed
    assert not bench.device.ready
    assert "has T5 the other way round than the vehicle file" in bench.device.trouble


def test_a_parameter_that_is_changed_before_a_flight_counts_in_it() -> None:
    bench = Bench()
    bench.run(3.0)
    bench.stranger(23, 0.0, 1, 1, b"FS_PILOT_INPUT", 9)
    bench.run(0.5)
    assert "its FS_PILOT_INPUT is 0" in bench.device.trouble


def test_sticks_that_are_told_no_more_end_the_flight() -> None:
    bench = Bench()
    bench.fly(*AHEAD)
    bench.board.unsupported.add(511)
    del bench.board.channels[0].intervals_s[65]
    bench.run(5.0)
    assert bench.device.fault().startswith("it tells its sticks no more (RC_CHANNELS)")
    assert not bench.board.armed


def test_bytes_that_are_no_unsigned_mavlink_2_are_called_that() -> None:
    """MAVLink 1, signed frames, another baud rate: to miss a heartbeat sends the reader to cables and addresses."""
    for garbage in (b"\xfe\x09\x00\x01\x01\x00" * 20, b"\xfd\x09\x01\x00\x00\x01\x01\x00\x00\x00" * 20):
        device = ArduSub(HEAVY)
        device.start(Stamp(1))
        assert "ardusub: no heartbeat of an ArduPilot, wanted" in device.trouble
        list(device.feed(garbage, Stamp(2)))
        assert "ardusub: no unsigned MAVLink 2 (check its SERIALn_PROTOCOL, wanted 2" in device.trouble


def test_what_somebody_else_has_armed_is_neither_flown_nor_disarmed() -> None:
    bench = Bench()
    bench.run(3.0)
    bench.stranger(76, 1.0, *(0.0,) * 6, 400, 1, 1, 0)
    bench.run(1.2)
    bench.armed, bench.pulses = True, AHEAD
    bench.run(1.0)
    assert "armed already, by another ground station, or from here before a crash" in bench.device.fault()
    bench.armed = False
    bench.run(0.5)
    assert bench.board.armed
    assert bench.wire() == NEUTRAL


def test_a_refused_arming_without_a_word_is_told_once_the_word_is_overdue(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    bench.board.refuses_arming = "Compass not calibrated"
    monkeypatch.setattr(bench.board, "_text", lambda *_: None)
    bench.run(3.0)
    bench.armed = True
    bench.run(1.0)
    assert bench.device.fault() == "the autopilot does not arm: answered with result 4"
    assert not bench.board.armed


def test_a_refused_arming_is_told_in_the_autopilot_s_words() -> None:
    bench = Bench()
    bench.board.refuses_arming = "Compass not calibrated"
    bench.run(3.0)
    bench.armed = True
    bench.run(1.0)
    assert bench.device.fault() == "the autopilot does not arm: Arm: Compass not calibrated"
    assert not bench.board.armed
    bench.armed = False
    bench.board.refuses_arming = ""
    bench.run(0.2)
    bench.armed = True
    bench.run(1.0)
    assert bench.board.armed


def test_a_long_reason_is_told_whole() -> None:
    """More than the 50 bytes of a message: it comes in parts, but from the arming checks, which cut it themselves."""
    why = "the safety switch has to be pressed, and then once more for a second"
    bench = Bench()
    bench.board.refuses_arming = why
    bench.run(3.0)
    bench.armed = True
    bench.run(0.5)
    assert bench.device.fault() == f"the autopilot does not arm: Arm: {why}"
    assert f"ardusub: Arm: {why}" in bench.texts()


def test_a_refused_mode_is_told_as_one_although_its_reason_comes_behind_the_answer() -> None:
    bench = Bench()
    bench.run(3.0)
    bench.board.mode, bench.board.refuses_modes = firmware.STABILIZE, "Flight mode change failed"
    bench.run(1.2)
    bench.armed = True
    bench.run(1.0)
    assert bench.device.fault() == "the autopilot does not arm: MANUAL: Flight mode change failed"


def test_what_it_has_said_long_before_is_not_the_reason_of_a_change() -> None:
    bench = Bench()
    bench.fly(*AHEAD)
    bench.board._text(firmware.WARNING, "Warning: Arming Checks Disabled")
    bench.run(3.0)
    change_mode(bench)
    assert bench.device.fault() == "another party, or a failsafe, has taken over: STABILIZE"


def test_after_motor_tests_it_waits_for_the_pause_that_the_autopilot_asks_for() -> None:
    bench = Bench(control="motor_test")
    bench.fly(*AHEAD)
    bench.armed = False
    bench.run(1.0)
    bench.armed = True
    bench.run(0.2)
    assert "more of a pause after a motor test; arm again then" in bench.device.fault()
    bench.armed = False
    bench.run(10.5)
    bench.armed = True
    bench.run(1.0)
    assert bench.wire() == AHEAD
    assert not [text for text in bench.texts() if "cooldown" in text]


def old(board: firmware.ArduSub) -> None:
    board.version = (4, 1, 1)


def unreleased(board: firmware.ArduSub) -> None:
    """A development version between those that have six axes."""
    board.version = (4, 2, 0)


def unprotected(board: firmware.ArduSub) -> None:
    board.parameters["FS_PILOT_INPUT"] = 0.0


def rewired(board: firmware.ArduSub) -> None:
    board.parameters["SERVO3_FUNCTION"] = 59.0


def custom(board: firmware.ArduSub) -> None:
    board.parameters["FRAME_CONFIG"] = 7.0


def simple(board: firmware.ArduSub) -> None:
    """SIMPLEROV_4, three thrusters: no vehicle in the box, so no file can be made from a log of it."""
    board.parameters |= {"FRAME_CONFIG": 4.0} | {f"SERVO{number}_FUNCTION": 0.0 for number in range(4, 9)}


def larger(board: firmware.ArduSub) -> None:
    """A heavy kit behind the file of six thrusters: its two more motors are driven by the same sticks."""
    board.parameters |= {"FRAME_CONFIG": 2.0, "SERVO7_FUNCTION": 39.0, "SERVO8_FUNCTION": 40.0}


def another(board: firmware.ArduSub) -> None:
    """BLUEROV1: two of its thrusters look to where others of the file do, but not its vertical ones."""
    board.parameters |= {"FRAME_CONFIG": 0.0}


def turned(board: firmware.ArduSub) -> None:
    board.parameters["MOT_5_DIRECTION"] = -board.parameters["MOT_5_DIRECTION"]


def streamless(board: firmware.ArduSub) -> None:
    board.unsupported.add(511)


class Unheard(dict[str, float]):
    """Parameters of which one is never answered for."""

    name = ""

    def __contains__(self, key: object) -> bool:
        return key != self.name and super().__contains__(key)


def unheard(name: str) -> Callable[[firmware.ArduSub], None]:
    def change(board: firmware.ArduSub) -> None:
        board.parameters = Unheard(board.parameters)
        board.parameters.name = name

    return change


@pytest.mark.parametrize(
    ("change", "lack"),
    [
        (unheard("SERVO3_FUNCTION"), "it does not answer for SERVO3_FUNCTION, which every ArduSub has; check the link"),
        (unheard("MOT_5_DIRECTION"), "it does not answer for MOT_5_DIRECTION, which every ArduSub has"),
        (unheard("FS_PILOT_INPUT"), "it does not answer for FS_PILOT_INPUT, which every ArduSub has"),
        (old, "its release is 4.1.1, whose MANUAL_CONTROL has no pitch and roll, wanted 4.1.2, or 4.5 or later"),
        (unreleased, "its release is 4.2.0, whose MANUAL_CONTROL has no pitch and roll"),
        (unprotected, "its FS_PILOT_INPUT is 0"),
        (rewired, "T3 is at output 3 in the vehicle file, where SERVO3_FUNCTION is 59, wanted a motor"),
        (rewired, "; take the file of this vehicle: `./hindrax vehicle new NAME --from LOG`"),
        (simple, "SERVO4_FUNCTION is 0, wanted a motor, 33 to 40; no file is made for this frame: describe its"),
        (another, "its FRAME_CONFIG is 0, with 6 motors that are known, and the vehicle file has 8; no file is made"),
        (turned, "its frame 2 has T5 the other way round than the vehicle file"),
        (custom, "its FRAME_CONFIG is 7"),
        (streamless, "it does not stream SERVO_OUTPUT_RAW"),
    ],
)
def test_what_lacks_something_is_refused_by_name(change: Callable[[firmware.ArduSub], None], lack: str) -> None:
    bench = Bench()
    change(bench.board)
    bench.run(5.0)
    assert not bench.device.ready
    assert lack in bench.device.trouble
    assert lack in " ".join(bench.texts())


def test_another_vehicle_is_called_by_its_type_and_one_beside_ours_is_left_alone() -> None:
    """Of a boat that carries the vehicle the line may bring the heartbeat first."""
    bench = Bench()
    bench.board.disguise(on=True)
    bench.run(3.0)
    wanted = "wanted the heartbeat of an ArduSub; check address, power and router"
    assert bench.device.trouble == f"ardusub: an autopilot of a vehicle of MAV_TYPE 2, {wanted}"
    boat, ardupilot, disarmed = 11, 3, 0x41
    beat = frame(0, (0, boat, ardupilot, disarmed, 3, 3), 0, 2, 1)
    bench = Bench()
    link = bench.link.step
    bench.link.step = lambda now_s: beat + link(now_s)  # type: ignore[method-assign]
    bench.fly(*AHEAD)
    assert bench.wire() == pytest.approx(AHEAD, abs=3.0)


@pytest.mark.parametrize(
    ("change", "lack"),
    [
        (rewired, "T3 is at output 3 in the vehicle file, where SERVO3_FUNCTION is 59, wanted a motor"),
        (another, "its FRAME_CONFIG is 0, with 6 motors that are known, and the vehicle file has 8"),
        (turned, "its frame 2 has T5 the other way round than the vehicle file"),
        (custom, ""),
        (unprotected, ""),
        (old, ""),
    ],
)
def test_motor_tests_want_the_thrusters_of_the_file_and_no_mixer(
    change: Callable[[firmware.ArduSub], None], lack: str
) -> None:
    bench = Bench(control="motor_test")
    change(bench.board)
    bench.run(5.0)
    assert bench.device.ready is not bool(lack)
    assert lack in bench.device.trouble


@pytest.mark.parametrize("seed", range(6))
def test_a_link_that_loses_two_fifths_both_ways_makes_no_other_autopilot_of_it(seed: int) -> None:
    """What was never answered was taken for 0: an output without a motor, a motor that is not turned, no failsafe."""
    bench = Bench(loss=0.4, seed=seed)
    bench.run(25.0)
    assert bench.device.identity, bench.device.trouble
    assert bench.texts() == []


def test_no_release_is_waited_for_until_it_answers_for_the_name_that_a_parameter_has_in_another() -> None:
    """On a link that loses messages that is 5 s, in which nothing can be armed."""
    bench = Bench()
    assert {"MAV_GCS_SYSID", "SYSID_MYGCS"} - bench.board.parameters.keys() == {"MAV_GCS_SYSID"}
    bench.run(0.8)
    assert bench.device.ready


@pytest.mark.parametrize("version", [(4, 1, 2), (4, 5, 0), (4, 7, 0)])
def test_releases_whose_sticks_have_pitch_and_roll_fly_eight_thrusters(version: tuple[int, int, int]) -> None:
    """4.1.2, the last before 4.5 and long the stable one, got its two axes as well."""
    bench = Bench()
    bench.board.version = version
    bench.run(3.0)
    assert bench.device.ready, bench.device.trouble


def test_motors_that_the_file_does_not_have_are_refused_by_name() -> None:
    bench = Bench(STANDARD)
    larger(bench.board)
    bench.run(5.0)
    assert not bench.device.ready
    assert "its frame 2 drives motors 7, 8 too, at outputs 7, 8, which are no thrusters of the vehicle file" in (
        bench.device.trouble
    )


def test_the_file_of_another_frame_with_as_many_thrusters_is_not_called_one_to_be_turned() -> None:
    bench = Bench(STANDARD)
    another(bench.board)
    bench.run(5.0)
    assert "its frame 0 has T3, T4, T6 pushing across what the vehicle file says" in bench.device.trouble
    assert "turn them" not in bench.device.trouble


def test_a_line_that_was_lost_in_flight_comes_back_to_a_disarmed_vehicle() -> None:
    bench = Bench()
    bench.fly(*AHEAD)
    bench.armed = False
    bench.take(bench.device.start(bench.now))
    bench.run(2.9)
    assert bench.device.ready
    assert not bench.board.armed


def test_six_thrusters_of_the_standard_frame_fly_as_well() -> None:
    bench = Bench(STANDARD)
    pulses = (1420.0, 1420.0, 1580.0, 1580.0, 1560.0, 1540.0)
    bench.fly(*pulses)
    assert bench.wire() == pytest.approx(pulses, abs=2.0)


@pytest.mark.parametrize("control", ["manual_control", "motor_test"])
@pytest.mark.parametrize("fault", ["link_loss", "link_delay"])
def test_a_poor_link_flies_on(control: str, fault: str) -> None:
    bench = Bench(control=control, fault=fault)
    bench.fly(*AHEAD)
    bench.run(6.0)
    assert bench.device.fault() == ""
    assert bench.wire() == AHEAD
    assert bench.board.armed


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("second_station", "another party has taken over: stick"),
        ("absent", "the autopilot has fallen silent"),
        ("reset", "the autopilot has"),
        ("repeated", "the autopilot has fallen silent"),
    ],
)
def test_a_link_that_fails_ends_the_flight_by_name_at_neutral(fault: str, why: str) -> None:
    bench = Bench(fault=fault)
    bench.fly(*AHEAD)
    bench.run(4.5)
    assert bench.device.fault().startswith(why)
    bench.armed = False
    bench.run(4.0)
    assert fault == "second_station" or bench.wire() == NEUTRAL


@pytest.mark.parametrize("control", ["manual_control", "motor_test"])
def test_who_thrusts_at_once_takes_no_delay_of_the_link_for_a_stranger(control: str) -> None:
    bench = Bench(control=control, fault="link_delay")
    bench.run(5.2)
    bench.armed, bench.pulses = True, AHEAD
    bench.run(3.0)
    assert bench.device.fault() == ""
    assert bench.wire() == AHEAD
