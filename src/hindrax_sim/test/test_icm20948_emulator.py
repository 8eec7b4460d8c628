"""The ICM-20948 emulator, register by register, as its data sheet has it (TDK DS-000189 r1.3)."""

import struct

import pytest

from hindrax_sim.devices.emulator import NackError
from hindrax_sim.devices.icm20948 import Icm20948
from hindrax_sim.devices.imu.imu_signal import ImuTruth, SensorErrors, typical

TRUTH = ImuTruth((1.0, -2.0, 9.5), (0.1, -0.2, 0.3), (20e-6, -10e-6, 30e-6), 30.0)


class Host:
    """A clock and single register accesses."""

    def __init__(self, part: Icm20948) -> None:
        self.part, self.now_s = part, 50.0
        part.set_truth(TRUTH, self.now_s)

    def put(self, register: int, *values: int) -> None:
        self.part.write(bytes([register, *values]), self.now_s)

    def get(self, register: int, count: int = 1) -> bytes:
        self.part.write(bytes([register]), self.now_s)
        return self.part.read(count, self.now_s)

    def wake(self) -> None:
        self.put(0x7F, 0x00)
        self.put(0x06, 0x01)
        self.sleep(0.05)

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds

    def sample(self) -> tuple[int, ...]:
        return struct.unpack(">6h", self.get(0x2D, 12))


@pytest.fixture
def host() -> Host:
    return Host(Icm20948(1, SensorErrors(noise=0.05)))


def test_identity_and_values_at_power_on(host: Host) -> None:
    assert host.get(0x00) == b"\xea"
    host.sleep(0.1)
    assert host.get(0x05, 2) == b"\x40\x41"
    host.put(0x00, 0x12)
    assert host.get(0x00) == b"\xea"


def test_the_four_banks_are_apart(host: Host) -> None:
    host.put(0x7F, 0x20)
    host.put(0x00, 0x0A)
    assert host.get(0x00) == b"\x0a"
    assert host.get(0x7F) == b"\x20"
    host.put(0x7F, 0x00)
    assert host.get(0x00) == b"\xea"


def test_it_sleeps_after_power_on_and_gives_nothing(host: Host) -> None:
    host.sleep(1.0)
    assert host.sample() == (0, 0, 0, 0, 0, 0)
    assert host.get(0x1A) == b"\x00"
    host.wake()
    assert host.sample() != (0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(("off", "accel", "gyro"), [(0x38, False, True), (0x07, True, False), (0x3F, False, False)])
def test_what_is_switched_off_measures_no_more(host: Host, off: int, accel: bool, gyro: bool) -> None:
    host.wake()
    before = host.sample()
    host.put(0x07, off)
    host.part.set_truth(ImuTruth((-5.0, 5.0, -5.0), (-1.0, 1.0, -1.0)), host.now_s)
    host.sleep(0.5)
    after = host.sample()
    assert (after[:3] != before[:3], after[3:] != before[3:]) == (accel, gyro)


def test_a_reset_clears_all_registers_and_takes_its_time(host: Host) -> None:
    host.wake()
    host.put(0x03, 0x40)
    host.put(0x06, 0x80)
    assert host.get(0x06)[0] & 0x80
    host.sleep(0.01)
    assert host.get(0x06) == b"\x41"
    assert host.get(0x03) == b"\x00"


@pytest.mark.parametrize(("select", "gyro", "accel"), [(0, 131.0, 16384.0), (1, 65.5, 8192.0), (3, 16.4, 2048.0)])
def test_scales(host: Host, select: int, gyro: float, accel: float) -> None:
    host.wake()
    host.put(0x7F, 0x20)
    host.put(0x01, select << 1 | 1)
    host.put(0x14, select << 1 | 1)
    host.put(0x7F, 0x00)
    host.sleep(0.5)
    sample = host.sample()
    assert [raw / accel * 9.80665 for raw in sample[:3]] == pytest.approx(TRUTH.specific_force_mps2, abs=0.02)
    assert [raw / gyro / 57.29578 for raw in sample[3:]] == pytest.approx(TRUTH.rate_radps, abs=0.002)


def test_temperature(host: Host) -> None:
    assert struct.unpack(">h", host.get(0x39, 2))[0] / 333.87 + 21.0 == pytest.approx(30.0, abs=0.002)


def test_a_motion_beyond_the_range_stays_at_its_end(host: Host) -> None:
    host.part.set_truth(ImuTruth((100.0, -100.0, 0.0), (20.0, -20.0, 0.0)), host.now_s)
    host.wake()
    host.sleep(1.0)
    assert host.sample()[:2] == (32767, -32768)
    assert host.sample()[3:5] == (32767, -32768)


def test_data_ready_is_reported_once_per_sample(host: Host) -> None:
    host.put(0x7F, 0x20)
    host.put(0x00, 4)
    host.wake()
    assert host.get(0x1A) == b"\x01"
    assert host.get(0x1A) == b"\x00"
    host.sleep(1.1 / 225.0)
    assert host.get(0x1A) == b"\x01"


def fill(host: Host, chosen: int = 0x1E, mode: int = 0x00) -> None:
    host.put(0x7F, 0x20)
    host.put(0x00, 4)
    host.wake()
    host.put(0x67, chosen)
    host.put(0x69, mode)
    host.put(0x03, 0x40)
    host.put(0x68, 0x1F)
    host.put(0x68, 0x00)


def count(host: Host) -> int:
    return int.from_bytes(host.get(0x70, 2), "big")


def test_the_fifo_collects_every_sample_and_pours_out_at_one_address(host: Host) -> None:
    fill(host)
    host.sleep(10.5 / 225.0)
    assert count(host) in (120, 132)
    samples = list(struct.iter_unpack(">6h", host.get(0x72, 120)))
    assert len(set(samples)) > 5
    assert samples[-1][2] / 16384.0 * 9.80665 == pytest.approx(9.5, abs=0.05)
    assert count(host) in (0, 12)


def test_a_full_stream_loses_its_beginning_and_a_snapshot_its_end(host: Host) -> None:
    for mode, wanted in ((0x00, 512), (0x01, 504)):
        fill(host, mode=mode)
        host.sleep(1.0)
        assert count(host) == wanted
        assert host.get(0x1B) == b"\x01"
        assert host.get(0x1B) == b"\x00"


def test_the_fifo_takes_what_is_chosen(host: Host) -> None:
    for chosen, size in ((0x10, 6), (0x0E, 6), (0x02, 2), (0x1F, 14)):
        fill(host, chosen)
        host.sleep(4.5 / 225.0)
        assert count(host) % size == 0
        assert count(host) in (4 * size, 5 * size)


def test_an_empty_fifo_gives_ones_and_a_held_one_stays_empty(host: Host) -> None:
    fill(host)
    host.put(0x68, 0x1F)
    host.sleep(0.1)
    assert count(host) == 0
    assert host.get(0x72, 2) == b"\xff\xff"


def test_samples_come_on_a_clock_of_its_own() -> None:
    host = Host(Icm20948(1, SensorErrors(clock_error=0.02, noise=0.05)))
    fill(host)
    total = 0
    for _ in range(100):
        host.sleep(0.1)
        total += count(host)
        host.get(0x72, count(host))
    assert total / 12 == pytest.approx(10.0 * 225.0 / 1.02, abs=2)


def test_the_self_test_moves_every_axis_as_the_factory_codes_say(host: Host) -> None:
    host.wake()
    host.sleep(0.2)
    before = host.sample()
    host.put(0x7F, 0x10)
    codes = host.get(0x02, 3) + host.get(0x0E, 3)
    host.put(0x7F, 0x20)
    host.put(0x02, 0x38)
    host.put(0x15, 0x1C)
    host.put(0x7F, 0x00)
    host.sleep(0.2)
    moved = [a - b for a, b in zip(host.sample(), before, strict=True)]
    wanted = [2620.0 * 1.01 ** (code - 1) for code in codes[3:] + codes[:3]]
    assert moved == pytest.approx(wanted, rel=0.02)


def bypass(host: Host) -> None:
    host.wake()
    host.put(0x0F, 0x02)


def test_the_magnetometer_is_on_the_bus_only_through_the_bypass(host: Host) -> None:
    mag = host.part.magnetometer
    with pytest.raises(NackError):
        mag.read(1, host.now_s)
    bypass(host)
    mag.write(b"\x00", host.now_s)
    assert mag.read(2, host.now_s) == b"\x48\x09"
    host.put(0x03, 0x20)
    with pytest.raises(NackError):
        mag.write(b"\x00", host.now_s)


def test_the_magnetometer_locks_its_data_until_st2_is_read(host: Host) -> None:
    bypass(host)
    mag = host.part.magnetometer
    mag.write(b"\x31\x08", host.now_s)
    host.sleep(0.011)
    mag.write(b"\x10", host.now_s)
    first = mag.read(7, host.now_s)
    assert first[0] == 0x01
    assert [raw * 0.15e-6 for raw in struct.unpack("<3h", first[1:])] == pytest.approx((20e-6, 10e-6, -30e-6), abs=1e-6)
    host.part.set_truth(ImuTruth(field_T=(0.0, 0.0, 0.0)), host.now_s)
    host.sleep(0.02)
    mag.write(b"\x11", host.now_s)
    assert mag.read(6, host.now_s) == first[1:]
    mag.write(b"\x18", host.now_s)
    mag.read(1, host.now_s)
    host.sleep(0.011)
    mag.write(b"\x10", host.now_s)
    assert abs(struct.unpack("<3h", mag.read(9, host.now_s)[1:7])[0]) < 10


def test_overrun_overflow_and_single_measurement(host: Host) -> None:
    bypass(host)
    mag = host.part.magnetometer
    mag.write(b"\x31\x08", host.now_s)
    host.sleep(0.055)
    mag.write(b"\x10", host.now_s)
    assert mag.read(1, host.now_s) == b"\x03"
    host.part.set_truth(ImuTruth(field_T=(4000e-6, 4000e-6, 0.0)), host.now_s)
    mag.write(b"\x31\x01", host.now_s)
    host.sleep(0.005)
    mag.write(b"\x18", host.now_s)
    mag.read(1, host.now_s)
    mag.write(b"\x10", host.now_s)
    assert mag.read(1, host.now_s)[0] & 1 == 0
    host.sleep(0.005)
    mag.write(b"\x10", host.now_s)
    block = mag.read(9, host.now_s)
    assert block[0] & 1
    assert block[8] == 0x08
    mag.write(b"\x31", host.now_s)
    assert mag.read(1, host.now_s) == b"\x00"


def test_the_inner_master_reads_and_writes_the_magnetometer(host: Host) -> None:
    host.wake()
    host.put(0x03, 0x20)
    host.put(0x7F, 0x30)
    for register, value in ((0x13, 0x0C), (0x14, 0x31), (0x16, 0x08), (0x15, 0x80)):
        host.put(register, value)
    assert host.get(0x15) == b"\x00"
    for register, value in ((0x13, 0x8C), (0x14, 0x01), (0x15, 0x80)):
        host.put(register, value)
    assert host.get(0x17) == b"\x09"
    for register, value in ((0x03, 0x8C), (0x04, 0x10), (0x05, 0x89)):
        host.put(register, value)
    host.put(0x7F, 0x00)
    assert host.get(0x17)[0] & 0x40
    host.sleep(0.02)
    external = host.get(0x3B, 9)
    assert external[0] & 1
    assert struct.unpack("<3h", external[1:7])[0] * 0.15e-6 == pytest.approx(20e-6, abs=1e-6)


def test_the_inner_master_reports_a_slave_that_is_not_there(host: Host) -> None:
    host.wake()
    host.put(0x03, 0x20)
    host.put(0x7F, 0x30)
    for register, value in ((0x13, 0xD0), (0x14, 0x00), (0x15, 0x80)):
        host.put(register, value)
    host.put(0x7F, 0x00)
    assert host.get(0x17)[0] & 0x50 == 0x50


def test_a_part_is_drawn_from_its_seed() -> None:
    assert typical(5) == typical(5)
    assert typical(5) != typical(6)
    one, two = (Host(Icm20948(7)) for _ in range(2))
    for host in (one, two):
        host.wake()
        host.sleep(0.3)
    assert one.sample() == two.sample()
