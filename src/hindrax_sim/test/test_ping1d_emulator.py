"""The emulated Ping1D against the Ping protocol's definitions; frames made by the vendor's encoder (brping 0.2.5)."""

import struct
from types import SimpleNamespace

import brping
import pytest

from hindrax_sim.devices.ping1d import Ping1d, PingTruth


def frames(data: bytes) -> list[tuple[int, bytes]]:
    """Cut a stream of good frames apart, checking every sum."""
    found = []
    while data:
        mark, length, message, source, target = struct.unpack_from("<2sHHBB", data)
        assert (mark, source, target) == (b"BR", 0, 0)
        assert sum(data[: 8 + length]) & 0xFFFF == int.from_bytes(data[8 + length : 10 + length], "little")
        found.append((message, data[8 : 8 + length]))
        data = data[10 + length :]
    return found


def host(message: int, payload: bytes) -> bytes:
    body = struct.pack("<2sHHBB", b"BR", len(payload), message, 0, 0) + payload
    return body + struct.pack("<H", sum(body) & 0xFFFF)


def run(device: Ping1d, start_s: float, stop_s: float, truth: PingTruth | None = None) -> list[tuple[int, bytes]]:
    data = b""
    for index in range(round((stop_s - start_s) / 0.005) + 1):
        device.set_truth(truth or PingTruth(2.0), 0.0)
        data += device.step(start_s + index * 0.005)
    return frames(data)


def ask(device: Ping1d, message: int) -> bytes:
    ((answer, payload),) = frames(device.receive(host(6, struct.pack("<H", message)), 0.0))
    assert answer == message
    return payload


ACKED = [
    ("set_mode_auto 1", "42 52 01 00 eb 03 00 00 01 84 01", 1003, 1205, "01"),
    ("set_ping_interval 100", "42 52 02 00 ec 03 00 00 64 00 e9 01", 1004, 1206, "64 00"),
    ("set_speed_of_sound 1500 m/s", "42 52 04 00 ea 03 00 00 60 e3 16 00 de 02", 1002, 1203, "60 e3 16 00"),
    ("set_ping_enable 1", "42 52 01 00 ee 03 00 00 01 87 01", 1006, 1215, "01"),
    (
        "set_range 100 5000",
        "42 52 08 00 e9 03 00 00 64 00 00 00 88 13 00 00 87 02",
        1001,
        1204,
        "64 00 00 00 88 13 00 00",
    ),
    ("set_device_id 7", "42 52 01 00 e8 03 00 00 07 87 01", 1000, 1201, "07"),
    ("set_device_id 7, as common.json has it", "42 52 01 00 64 00 00 00 07 00 01", 100, 1201, "07"),
]


@pytest.mark.parametrize(("name", "frame", "message", "get", "value"), ACKED)
def test_settings_are_acknowledged_and_can_be_asked_back(
    name: str, frame: str, message: int, get: int, value: str
) -> None:
    del name
    device = Ping1d()
    assert frames(device.receive(bytes.fromhex(frame), 0.0)) == [(1, struct.pack("<H", message))]
    assert ask(device, get) == bytes.fromhex(value)


def test_an_empty_frame_with_the_wanted_id_asks_too() -> None:
    """As brping does: 42 52 00 00 bb 04 00 00 53 01 asks for 1211."""
    ((message, payload),) = frames(Ping1d().receive(bytes.fromhex("42 52 00 00 bb 04 00 00 53 01"), 0.0))
    assert (message, len(payload)) == (1211, 5)


def test_who_it_is() -> None:
    assert ask(Ping1d(), 4)[0] == 1
    assert len(ask(Ping1d(), 5)) == 4


@pytest.mark.parametrize(
    ("message", "payload"),
    [
        (1001, struct.pack("<II", 0, 999)),
        (1003, b"\x02"),
        (1004, b"\x00\x00"),
        (1005, b"\x07"),
        (1100, b""),
        (9999, b"\x01"),
    ],
)
def test_what_cannot_be_is_refused(message: int, payload: bytes) -> None:
    ((answer, words),) = frames(Ping1d().receive(host(message, payload), 0.0))
    assert (answer, words[:2]) == (2, struct.pack("<H", message))
    assert len(words) > 2


def test_a_message_nobody_knows_is_refused() -> None:
    ((answer, words),) = frames(Ping1d().receive(host(6, struct.pack("<H", 4242)), 0.0))
    assert (answer, words[:2]) == (2, struct.pack("<H", 4242))


def test_junk_and_half_frames_from_the_host_do_no_harm() -> None:
    device = Ping1d()
    request = host(6, struct.pack("<H", 5))
    assert device.receive(b"UUU\x00BR\xff\xff\x00\x00\x00\x00" + request[:4], 0.0) == b""
    assert frames(device.receive(request[4:] + b"BB", 0.0))[0][0] == 5
    broken = request[:-1] + b"\xff"
    assert frames(device.receive(broken + request, 0.0))[0][0] == 5


def distance(payload: bytes) -> tuple[int, int, int]:
    mm, percent, _, number, *_ = struct.unpack_from("<IHHIIII", payload)
    return mm, percent, number


def test_a_stream_of_profiles_at_the_ping_interval() -> None:
    device = Ping1d(noise=0.0)
    run(device, 0.0, 1.0)
    for order in (host(1002, struct.pack("<I", 1_484_000)), host(1004, b"\x32\x00"), host(1400, b"\x14\x05")):
        device.receive(order, 1.0)
    found = run(device, 1.0, 6.0)
    assert {message for message, _ in found} == {1300}
    assert len(found) == pytest.approx(100, abs=4)
    numbers = [distance(payload)[2] for _, payload in found]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert {distance(payload)[:2] for _, payload in found} == {(2000, 100)}
    assert all(len(payload) == 26 + int.from_bytes(payload[24:26], "little") for _, payload in found)
    device.receive(host(1401, b"\x14\x05"), 6.0)
    run(device, 6.0, 6.1)
    assert run(device, 6.1, 8.0) == []


def test_distance_scales_with_the_speed_of_sound_that_was_set() -> None:
    device = Ping1d(noise=0.0)
    device.receive(host(1002, struct.pack("<I", 1_500_000)), 0.0)
    run(device, 0.0, 1.0, PingTruth(2.0, speed_of_sound_mps=1450.0))
    assert distance(ask(device, 1212))[0] == round(2000 * 1500 / 1450)


def test_without_an_echo_there_is_no_confidence_and_the_scan_reaches_further() -> None:
    device = Ping1d()
    run(device, 0.0, 2.0, PingTruth(None))
    assert distance(ask(device, 1212))[1] == 0
    start_mm, length_mm = struct.unpack("<II", ask(device, 1204))
    assert start_mm + length_mm > 20_000
    run(device, 2.0, 4.0, PingTruth(3.0))
    assert distance(ask(device, 1212))[1] == 100


def test_beyond_a_scan_set_by_hand_nothing_is_received() -> None:
    device = Ping1d()
    device.receive(host(1003, b"\x00") + host(1001, struct.pack("<II", 0, 1500)), 0.0)
    run(device, 0.0, 1.0, PingTruth(2.0))
    assert distance(ask(device, 1212))[1] == 0


def test_disabled_it_does_not_ping() -> None:
    device = Ping1d()
    device.receive(host(1006, b"\x00"), 0.0)
    run(device, 0.0, 1.0)
    assert distance(ask(device, 1212))[2] == 0


def test_a_power_cycle_forgets_settings_numbers_and_stream() -> None:
    device = Ping1d()
    device.receive(host(1400, b"\x14\x05") + host(1004, b"\x32\x00"), 0.0)
    assert run(device, 0.0, 1.0)
    device.power_cycle(1.0)
    assert run(device, 1.0, 2.0) == []
    assert ask(device, 1206) == b"\x64\x00"


def test_faults_of_its_own() -> None:
    device = Ping1d()
    device.saturate(True)
    run(device, 0.0, 1.0)
    assert distance(ask(device, 1212))[:2] == (0xFFFFFFFF, 100)
    device.disguise(True)
    assert ask(device, 4)[0] == 2
    assert frames(device.receive(host(1003, b"\x01"), 1.0))[0][0] == 2
    device.jump_clock(5.0)


class Serial:
    """A port of pyserial as the vendor's library uses it, with the sonar at its end; time goes by at every look."""

    def __init__(self, device: Ping1d) -> None:
        self._device, self._heard, self.now_s = device, b"", 0.0

    def write(self, data: bytes) -> int:
        self._heard += self._device.receive(bytes(data), self.now_s)
        return len(data)

    @property
    def in_waiting(self) -> int:
        self.sleep(0.005)
        return len(self._heard)

    def read(self, count: int) -> bytes:
        found, self._heard = self._heard[:count], self._heard[count:]
        return found

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        self._device.set_truth(PingTruth(2.0, speed_of_sound_mps=1500.0), 0.0)
        self._heard += self._device.step(self.now_s)


def test_the_vendor_s_own_library_reads_and_sets_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """bluerobotics-ping with its table of this sonar: in that of all sonars (its default), another has our numbers."""
    line = Serial(Ping1d(noise=0.0))
    monkeypatch.setattr(brping.device, "time", SimpleNamespace(time=lambda: line.now_s, sleep=line.sleep))
    sonar = brping.Ping1D(brping.definitions.payload_dict_ping1d)
    sonar.iodev = line
    assert sonar.initialize()
    line.sleep(2.0)
    found = sonar.get_distance()
    assert (found["distance"], found["confidence"]) == (2000, 100)
    assert sonar.get_distance_simple()["distance"] == 2000
    profile = sonar.get_profile()
    echo = profile["profile_data"].index(max(profile["profile_data"]))
    assert (echo + 0.5) * profile["scan_length"] / len(profile["profile_data"]) == pytest.approx(2000, abs=20)
    assert sonar.get_general_info()["voltage_5"] == sonar.get_voltage_5()["voltage_5"] == 5000
    assert sonar.get_processor_temperature() == {"processor_temperature": 3000}
    assert sonar.get_device_information()["device_type"] == 1
    assert sonar.set_mode_auto(0)
    assert sonar.set_range(100, 4000)
    assert sonar.set_gain_setting(3)
    assert sonar.set_ping_interval(100)
    assert sonar.set_device_id(7)
    assert sonar.get_oss_profile_configuration() is None, "of the open firmware alone"
