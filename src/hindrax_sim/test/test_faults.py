"""Fault specifications and each stream fault by itself."""

from dataclasses import replace
from itertools import groupby

import pytest
from vehicles_beside import hindrax_with, vehicle_beside

from hindrax_core.errors import UsageError
from hindrax_core.events import after
from hindrax_core.readings import Leak
from hindrax_core.vehicle import Mount
from hindrax_sim.faults.fault_registry import FAULTS, KINDS, FaultSpec, parse_fault, with_faults
from hindrax_sim.faults.fault_schedule import Scheduled
from hindrax_sim.faults.stream_faults import BitFlips, FaultyLine, StreamFault
from hindrax_sim.flights.lockstep_rigs import BytesRig

SERIAL = ("dvl75", "a50", "ping1d", "ardusub", "ardusub_ekf", "ardusub_range")


@pytest.mark.parametrize(
    ("text", "spec"),
    [
        ("garbage:dvl75@30+5", FaultSpec("garbage", ("dvl75",), 30.0, 5.0)),
        ("garbage", FaultSpec("garbage", SERIAL, 10.0, 5.0)),
        ("reset:ping1d", FaultSpec("reset", ("ping1d",), 10.0, 5.0)),
        ("clock_jump@0.5", FaultSpec("clock_jump", ("dvl75", "a50", "ardusub_ekf"), 0.5, 5.0)),
        ("merged@0+600", FaultSpec("merged", SERIAL, 0.0, 600.0)),
    ],
)
def test_what_is_asked_for(text: str, spec: FaultSpec) -> None:
    assert parse_fault(text) == spec


def test_a_fault_falls_on_the_sensors_of_the_vehicle_by_their_names() -> None:
    ahead = Mount("ping1d", "/dev/hindrax/ahead", rotation_deg=(0.0, 90.0, 0.0))
    vehicle = replace(hindrax_with(), sensors={"ahead": ahead, **hindrax_with().sensors})
    assert parse_fault("garbage", vehicle).devices == ("ahead", "dvl75", "ping1d")
    assert parse_fault("range_short:ahead", vehicle).devices == ("ahead",)
    assert parse_fault("velocity_frozen", vehicle).devices == ("dvl75",)
    with pytest.raises(UsageError, match="garbage on 'a50', wanted one of ahead, dvl75, ping1d"):
        parse_fault("garbage:a50", vehicle)
    with pytest.raises(UsageError, match="velocity_frozen falls on nothing aboard"):
        parse_fault("velocity_frozen", replace(vehicle, sensors={}))


def test_the_link_of_an_autopilot_is_that_of_the_output_and_of_the_sensors_on_it() -> None:
    vehicle = vehicle_beside("bluerov2-heavy")
    assert parse_fault("link_loss", vehicle).devices == ("thrusters",)
    assert parse_fault("garbage", vehicle).devices == ("dvl75", "ping1d")
    assert parse_fault("depth_stuck", vehicle).devices == ("autopilot",)
    with pytest.raises(UsageError, match="second_station falls on nothing aboard"):
        parse_fault("second_station", hindrax_with())


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("garbge:dvl75", "found 'garbge' (did you mean garbage?); the form is"),
        ("dvl75:garbage", "found 'dvl75' (did you mean garbage:dvl75?)"),
        ("garbage:dvl57", "garbage on 'dvl57' (did you mean dvl75?), wanted one of dvl75, a50"),
        ("", "found '', wanted one of absent, "),
        ("garbage:icm20948", "garbage on 'icm20948', wanted one of dvl75, a50, ping1d"),
        ("clock_jump:ping1d", "clock_jump on 'ping1d', wanted one of dvl75, a50"),
        ("garbage:@3", "garbage on '', wanted one of"),
        ("garbage@soon", "found 'soon', wanted seconds"),
        ("garbage@-1", "found '-1', wanted seconds"),
        ("garbage@nan", "found 'nan', wanted seconds"),
        ("garbage@1+", "found '', wanted seconds"),
        ("garbage@", "found '', wanted seconds"),
    ],
)
def test_what_is_wrong_with_it_is_reported(text: str, error: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_fault(text)
    assert error in str(caught.value)
    assert "NAME[:DEVICE][@START[+SECONDS]]" in str(caught.value)


def test_the_registry_has_every_stream_fault_of_the_sweep() -> None:
    names = "absent wrong_identity cut_frames bytewise merged garbage bit_flips baud_mismatch unplug_replug reset"
    assert set(FAULTS) >= {*names.split(), "clock_jump", "saturated", "repeated"}
    assert all(kind.name == name and kind.meaning and kind.devices() for name, kind in FAULTS.items())
    assert len(FAULTS) == len(KINDS), "two kinds have one name"


class Clockwork:
    """A device that says the same message every 0.1 s and writes down what is done to it."""

    def __init__(self, message: bytes = b"0123456789") -> None:
        self.message = message
        self.done: list[str] = []
        self.received = b""
        self._due_s = 0.1

    def step(self, now_s: float) -> bytes:
        emitted = b""
        while self._due_s <= now_s + 1e-9:
            emitted += self.message
            self._due_s += 0.1
        return emitted

    def receive(self, data: bytes, now_s: float) -> bytes:
        del now_s
        self.received += data
        return data.upper()

    def power_cycle(self, now_s: float) -> None:
        self.done.append(f"power at {now_s:.1f}")

    def jump_clock(self, seconds: float) -> None:
        self.done.append(f"jump {seconds:+.0f}")

    def disguise(self, on: bool) -> None:
        self.done.append(f"disguise {on}")

    def saturate(self, on: bool) -> None:
        self.done.append(f"saturate {on}")


def line(*names: str, start_s: float = 1.0, end_s: float = 2.0, seed: int = 1) -> FaultyLine:
    return FaultyLine(Clockwork(), [Scheduled(made(name, seed), start_s, end_s) for name in names])


def made(name: str, seed: int) -> StreamFault:
    make = FAULTS[name].make
    assert make is not None
    return make(seed)


def clockwork(faulty: FaultyLine) -> Clockwork:
    assert isinstance(faulty.device, Clockwork)
    return faulty.device


def chunks(faulty: FaultyLine, until_s: float) -> list[tuple[float, bytes]]:
    times = [0.05 * index for index in range(1, round(until_s / 0.05) + 1)]
    return [(now_s, chunk) for now_s in times for chunk in faulty.chunks(now_s)]


def during(found: list[tuple[float, bytes]], start_s: float = 1.0, end_s: float = 2.0) -> list[bytes]:
    return [chunk for now_s, chunk in found if start_s <= now_s < end_s - 1e-9]


@pytest.mark.parametrize("name", ["absent", "garbage", "cut_frames", "bytewise", "merged", "baud_mismatch"])
def test_before_and_after_everything_is_as_it_was_and_a_seed_repeats_itself(name: str) -> None:
    found = chunks(line(name), 3.0)
    assert during(found, 0.0, 1.0) == [b"0123456789"] * 9
    assert during(found, 2.1, 3.1) == [b"0123456789"] * 10
    assert found == chunks(line(name), 3.0)
    assert during(found) != [b"0123456789"] * 10


def test_absent_is_silent_and_deaf() -> None:
    faulty = line("absent")
    assert during(chunks(faulty, 1.5)) == []
    assert faulty.receive(b"hello", 1.6) == b""
    assert clockwork(faulty).received == b""
    assert faulty.connected


def test_an_unplugged_port_is_gone_and_the_device_without_power() -> None:
    faulty = line("unplug_replug")
    chunks(faulty, 1.5)
    assert not faulty.connected
    chunks(faulty, 3.0)
    assert faulty.connected
    assert clockwork(faulty).done == ["power at 2.0"]


@pytest.mark.parametrize(
    ("name", "done"),
    [
        ("wrong_identity", ["disguise True", "disguise False"]),
        ("saturated", ["saturate True", "saturate False"]),
        ("reset", ["power at 1.0"]),
        ("clock_jump", ["jump +1000", "jump -1000"]),
    ],
)
def test_faults_of_the_device_itself(name: str, done: list[str]) -> None:
    faulty = line(name)
    chunks(faulty, 3.0)
    assert clockwork(faulty).done == done


def test_bytewise_loses_nothing() -> None:
    found = during(chunks(line("bytewise"), 3.0))
    assert {len(chunk) for chunk in found} == {1}
    assert b"".join(found) == b"0123456789" * 10


def test_merged_loses_nothing_either() -> None:
    found, unbroken = (chunks(line(*names), 3.0) for names in (("merged",), ()))
    assert b"".join(chunk for _, chunk in found) == b"".join(chunk for _, chunk in unbroken)
    assert max(len(chunk) for _, chunk in found) >= 20


def test_cut_frames_are_parts_of_frames() -> None:
    found = during(chunks(line("cut_frames", end_s=9.0), 9.0), 1.0, 9.0)
    joined = b"".join(found)
    assert len(joined) < 800
    assert b"0123456789" in joined


def test_garbage_keeps_the_message_s_own_bytes_in_order() -> None:
    joined = b"".join(during(chunks(line("garbage"), 3.0)))
    assert len(joined) > 100
    left = iter(joined)
    assert all(byte in left for byte in b"0123456789" * 10)


def test_bit_flips_are_one_in_a_thousand() -> None:
    fault = BitFlips(7)
    (chunk,) = fault.outgoing(bytes(125_000), 0.0)
    assert sum(byte.bit_count() for byte in chunk) == pytest.approx(1000, rel=0.15)


def test_a_baud_mismatch_works_both_ways() -> None:
    faulty = line("baud_mismatch")
    found = during(chunks(faulty, 1.5))
    assert all(b"0123456789" not in chunk for chunk in found)
    faulty.receive(b"0123456789", 1.6)
    assert clockwork(faulty).received
    assert b"0123456789" not in clockwork(faulty).received


def test_repeated_states_its_first_words_again() -> None:
    faulty = line("repeated")
    chunks(faulty, 1.0)
    clockwork(faulty).message = b"new words"
    assert set(during(chunks(faulty, 2.0), 1.05)) == {b"0123456789"}


def test_faults_compose_in_order() -> None:
    found = during(chunks(line("merged", "bytewise"), 3.0))
    assert {len(chunk) for chunk in found} == {1}


def test_only_the_faults_of_a_device_fall_on_it() -> None:
    device = Clockwork()
    specs = [FaultSpec("garbage", ("dvl75",), 30.0, 5.0)]
    assert with_faults("ping1d", device, specs) is device
    faulty = with_faults("dvl75", device, specs, start_s=10.0)
    assert isinstance(faulty, FaultyLine)
    assert b"".join(chunk for _, chunk in chunks(faulty, 39.0)) == b"0123456789" * 390


def test_a_leak_reaches_the_probe_and_goes_with_the_water() -> None:
    rig = BytesRig(hindrax_with("sos_leak"), seed=1, faults=[FaultSpec("leak", ("hull",), 1.0, 1.0)])
    end, received = after(rig.world.stamp, 3.5), []
    while rig.world.stamp < end:
        received += [one for name, one in rig.advance() if name == "sos_leak"]
    reported = [key for key, _ in groupby(one.reading.wet for one in received if isinstance(one.reading, Leak))]
    assert reported == [False, True, False]
