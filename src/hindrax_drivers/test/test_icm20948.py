"""The inertial sensor's driver where it must doubt: fill levels, repeats, saturation, leaps, a lost magnetometer."""

import math
import struct
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeVar

import pytest

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Program, Read, Transaction, Write, WriteRead
from hindrax_core.errors import UsageError
from hindrax_core.events import Rejected, Stamp, Stamped, after, stamp_from_s
from hindrax_core.knobs import build
from hindrax_core.readings import Inertial, Magnetic, Reading
from hindrax_core.testing import rehearse
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.devices.icm20948 import DRIVER, MISALIGNED, NO_DATA_S, SILENT_LINE, Icm20948
from hindrax_drivers.devices.imu.ak09916 import REPEATS as MAG_REPEATS
from hindrax_drivers.devices.imu.ak09916 import SET_UP_EVERY_S, Ak09916
from hindrax_drivers.devices.imu.icm20948_samples import HUNG_AFTER, REPEATS, EdgeClock, Icm20948Knobs
from hindrax_drivers.imu_calibration import Correction

START = stamp_from_s(10.0)
LEVEL = (0, 0, 8192, 0, 0, 0)
Outputs = Sequence[Stamped[Reading] | Rejected]
ResultT = TypeVar("ResultT")


class Chip:
    """Answers what the driver asks: identity, temperature, magnetic field, and a FIFO filled by the test."""

    def __init__(self) -> None:
        self.fifo = b""
        self.count: int | None = None
        self.resets = 0
        self.registers: dict[int, int] = {}
        self.asked: list[tuple[int, int]] = []
        self._wobble = 0

    def fill(self, *samples: tuple[int, ...]) -> None:
        self.fifo += b"".join(struct.pack(">6h", *sample) for sample in samples)

    def still(self, count: int) -> None:
        """Samples at rest, with a little noise so that none is equal to the one before."""
        for _ in range(count):
            self._wobble ^= 1
            self.fill((self._wobble, 0, 8192, 0, 0, 0))

    def transfer(self, operation: Transaction) -> bytes:
        assert isinstance(operation, Write | WriteRead)
        register = operation.data[0]
        self.asked.append((operation.address, register))
        if operation.address == 0x0C:
            field = b"\x01" + struct.pack("<3h", len(self.asked), 0, 50) + bytes(2)
            return b"" if isinstance(operation, Write) else b"\x48\x09" if register == 0 else field
        if isinstance(operation, Write):
            if register == 0x68 and operation.data[1]:
                self.resets += 1
                self.fifo = b""
            self.registers[register] = operation.data[-1]
            if register == 0x06 and operation.data[1] & 0x80:  # out of its reset at once
                self.registers[register] = 0x01
            return b""
        if register == 0x72:
            data, self.fifo = self.fifo[: operation.count], self.fifo[operation.count :]
            return data
        special = {0x00: b"\xea", 0x39: b"\0\0"}
        if register == 0x70:
            return (len(self.fifo) if self.count is None else self.count).to_bytes(2, "big")
        return special.get(register) or bytes([self.registers[register]])


def play(program: Program[ResultT], chip: Chip) -> ResultT:
    answer: bytes | None = None
    try:
        while True:
            operation: Operation = next(program) if answer is None else program.send(answer)
            answer = b"" if isinstance(operation, Pause) else chip.transfer(operation)
    except StopIteration as stop:
        result: ResultT = stop.value
        return result


@pytest.fixture
def chip() -> Chip:
    return Chip()


@pytest.fixture
def sensor(chip: Chip) -> Icm20948:
    one = Icm20948(Icm20948Knobs(magnetometer=False))
    play(one.configure(), chip)
    chip.still(4)
    assert len(play(one.cycle(START), chip)) == 4
    return one


def cycle(sensor: Icm20948, chip: Chip, turn: int) -> Outputs:
    return play(sensor.cycle(after(START, 0.02 * turn)), chip)


def reasons(outputs: Outputs) -> list[str]:
    return [one.reason for one in outputs if isinstance(one, Rejected)]


def test_samples_are_stamped_by_their_clock_not_by_the_wake_up(sensor: Icm20948, chip: Chip) -> None:
    stamps = []
    for turn, late_s in enumerate([0.0, 0.003, 0.0, 0.015, 0.001, 0.0], start=1):
        chip.still(5)
        outputs = play(sensor.cycle(after(START, 5 / 225.0 * turn + late_s)), chip)
        stamps += [one.stamp for one in outputs]
    steps = [(b - a) / 1e9 for a, b in pairwise(stamps)]
    assert steps == pytest.approx([1 / 225.0] * len(steps), abs=1e-5)


def test_a_fetch_that_waited_for_the_processor_makes_no_later_stamp_early(sensor: Icm20948, chip: Chip) -> None:
    """The clock was read 18 ms before the FIFO: samples that came meanwhile seemed older than their fetch."""
    for turn in range(1, 60):
        chip.still(5)
        fetched = after(START, 5 / 225.0 * turn)
        newest = play(sensor.cycle(after(fetched, -0.018 if turn == 30 else 0.0)), chip)[-1].stamp
        if turn > 30:
            assert (fetched - newest) / 1e9 == pytest.approx(Icm20948Knobs().filter_delay_s, abs=1e-3)


def test_a_host_clock_that_is_set_back_takes_the_stamps_with_it(sensor: Icm20948, chip: Chip) -> None:
    for turn in range(1, 20):
        chip.still(5)
        cycle(sensor, chip, turn)
    earlier = stamp_from_s(1.0)
    for turn in range(20):
        chip.still(5)
        now = after(earlier, 5 / 225.0 * turn)
        stamps = [one.stamp for one in play(sensor.cycle(now), chip)]
        assert all(now - 40_000_000 < stamp <= now for stamp in stamps)
    silent = after(earlier, -0.5)
    assert list(play(sensor.cycle(silent), chip)) == []
    with pytest.raises(DeviceError, match="no sample"):
        play(sensor.cycle(after(silent, 0.3)), chip)


def test_an_overflow_is_reported_and_emptied_and_what_comes_then_begins_anew(sensor: Icm20948, chip: Chip) -> None:
    chip.still(43)
    assert reasons(cycle(sensor, chip, 1)) == ["FIFO overflow: 516 bytes waiting, samples are lost"]
    assert chip.fifo == b""
    chip.fill(*[(8192, turn, 0, 0, 0, 0) for turn in range(5)])  # turned over in the meantime
    outputs = cycle(sensor, chip, 26)
    assert reasons(outputs) == []
    assert len(outputs) == 5
    assert after(START, 0.52 - 0.03) < outputs[0].stamp <= outputs[-1].stamp <= after(START, 0.52)


def test_a_sensor_that_is_configured_anew_begins_anew(sensor: Icm20948, chip: Chip) -> None:
    play(sensor.configure(), chip)
    chip.fill(*[(8192, turn, 0, 0, 0, 0) for turn in range(5)])
    assert [type(one) for one in cycle(sensor, chip, 1)] == [Stamped] * 5


def test_a_half_written_sample_is_waited_for(sensor: Icm20948, chip: Chip) -> None:
    chip.still(3)
    whole, chip.fifo = chip.fifo, chip.fifo[:-5]
    assert list(cycle(sensor, chip, 1)) == []
    chip.fifo = whole
    assert len(cycle(sensor, chip, 2)) == 3


def test_a_fifo_out_of_step_is_emptied(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    play(sensor.configure(), chip)
    for begin in (0, MISALIGNED):
        chip.still(3)
        chip.fifo = chip.fifo[:-5]
        before = chip.resets
        refused = [reasons(cycle(sensor, chip, begin + turn)) for turn in range(MISALIGNED)]
        assert [len(one) for one in refused] == [0] * (MISALIGNED - 1) + [1]
        assert "out of step" in refused[-1][0]
        assert chip.resets == before + 1


@pytest.mark.parametrize(("count", "accepted"), [(8, True), (9, False)])
def test_a_turn_brings_four_samples_and_a_tenth_more_than_its_time(
    sensor: Icm20948, chip: Chip, count: int, accepted: bool
) -> None:
    """4 + 1.1 * 0.02 s * 225 Hz = 8.95."""
    chip.still(count)
    assert (reasons(cycle(sensor, chip, 1)) == []) is accepted


def test_a_count_that_time_cannot_have_brought_is_not_read(sensor: Icm20948, chip: Chip) -> None:
    chip.still(5)
    chip.count = 12 * 20
    assert "more than 0.020 s can have brought" in reasons(cycle(sensor, chip, 1))[0]


def test_a_sensor_that_gives_nothing_is_configured_anew(sensor: Icm20948, chip: Chip) -> None:
    turns = int(NO_DATA_S / 0.02)
    for turn in range(1, turns + 1):
        assert list(cycle(sensor, chip, turn)) == []
    with pytest.raises(DeviceError, match=r"no sample for 0.25 s"):
        cycle(sensor, chip, turns + 2)


def test_the_silence_of_a_sensor_that_was_just_configured_begins_with_the_first_look(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    for _ in range(2):
        play(sensor.configure(), chip)
        assert list(play(sensor.cycle(START), chip)) == []
        assert list(play(sensor.cycle(after(START, NO_DATA_S)), chip)) == []
        with pytest.raises(DeviceError, match=r"no sample for 0.25 s"):
            play(sensor.cycle(after(START, NO_DATA_S + 0.01)), chip)


def failing(sensor: Icm20948, chip: Chip, turn: int, register: int, *, taken: bool = False) -> Outputs:
    """A cycle of which the transfer of one register fails on the wire, before or after it has taken the bytes."""
    program = sensor.cycle(after(START, 0.02 * turn))
    try:
        operation = next(program)
        while True:
            assert isinstance(operation, Write | WriteRead)
            fails = operation.data[0] == register
            answer = b"" if fails and not taken else chip.transfer(operation)
            operation = program.throw(NACK) if fails else program.send(answer)
    except StopIteration as stop:
        outputs: Outputs = stop.value
        return outputs


@pytest.mark.parametrize("register", [0x70, 0x72])
@pytest.mark.parametrize("failures", [1, 5])
def test_transfers_that_are_not_acknowledged_cost_no_sample(
    sensor: Icm20948, chip: Chip, register: int, failures: int
) -> None:
    for turn in range(1, 1 + failures):
        chip.still(4)
        assert reasons(failing(sensor, chip, turn, register)) == ["no acknowledge; tried again"]
    chip.still(4)
    outputs = cycle(sensor, chip, 1 + failures)
    assert [type(one) for one in outputs] == [Stamped] * 4 * (1 + failures)
    assert chip.resets == 1


def test_a_burst_that_was_broken_off_costs_its_samples_and_no_set_up(sensor: Icm20948, chip: Chip) -> None:
    chip.still(4)
    assert reasons(failing(sensor, chip, 1, 0x72, taken=True)) == ["no acknowledge; tried again"]
    chip.fifo += bytes(7)
    assert len(reasons(cycle(sensor, chip, 2))) == 1
    chip.still(4)
    outputs = cycle(sensor, chip, 3)
    assert [type(one) for one in outputs] == [Stamped] * 4
    assert after(START, 0.06 - 0.03) < outputs[-1].stamp <= after(START, 0.06)


def test_a_burst_that_took_whole_samples_leaves_the_time_of_the_next_ones(sensor: Icm20948, chip: Chip) -> None:
    for turn in range(1, 4):
        chip.still(4)
        cycle(sensor, chip, turn)
    chip.still(4)
    failing(sensor, chip, 4, 0x72, taken=True)
    chip.still(4)
    outputs = cycle(sensor, chip, 5)
    assert [type(one) for one in outputs] == [Stamped] * 4
    assert after(START, 0.1 - 0.01) < outputs[-1].stamp <= after(START, 0.1)


def test_transfers_that_fail_for_longer_than_a_sensor_may_be_silent_configure_it_anew(
    sensor: Icm20948, chip: Chip
) -> None:
    chip.still(4)
    cycle(sensor, chip, 1)
    last = 1 + round(NO_DATA_S / 0.02)
    for turn in range(2, last + 1):
        assert len(failing(sensor, chip, turn, 0x70)) == 1
    with pytest.raises(DeviceError, match="no acknowledge"):
        failing(sensor, chip, last + 1, 0x70)


def test_a_sensor_that_is_asleep_after_a_failed_transfer_is_configured_anew_at_once(
    sensor: Icm20948, chip: Chip
) -> None:
    failing(sensor, chip, 1, 0x70)
    chip.registers[0x06] = 0x41
    with pytest.raises(DeviceError, match="has reset itself"):
        cycle(sensor, chip, 2)


def test_equal_samples_are_refused_and_a_hung_sensor_is_configured_anew(sensor: Icm20948, chip: Chip) -> None:
    chip.fill(*[(7, 7, 8192, 7, 7, 7)] * 5)
    outputs = cycle(sensor, chip, 1)
    assert [isinstance(one, Rejected) for one in outputs] == [False] * (1 + REPEATS) + [True] * (4 - REPEATS)
    for turn in range(2, 1 + HUNG_AFTER // 4):
        chip.fill(*[(7, 7, 8192, 7, 7, 7)] * 4)
        assert all(isinstance(one, Rejected) for one in cycle(sensor, chip, turn))
    chip.fill(*[(7, 7, 8192, 7, 7, 7)] * 5)
    with pytest.raises(DeviceError, match="repeats the same sample"):
        cycle(sensor, chip, 1 + HUNG_AFTER // 4)


def test_the_first_samples_may_be_equal_as_often_as_later_ones_and_twice_now_and_then_for_ever(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    play(sensor.configure(), chip)
    chip.fill(*[(7, 7, 8192, 7, 7, 7)] * 5)
    assert reasons(cycle(sensor, chip, 0)) == ["4 equal samples", "5 equal samples"]
    for turn in range(1, 10):
        chip.fill(*[(turn, step, 8192, 0, 0, 0) for step in (0, 0, 1, 1)])
        assert reasons(cycle(sensor, chip, turn)) == []


@pytest.mark.parametrize("raw", [(32767, 0, 8192, 0, 0, 0), (0, 0, 8192, 0, -32768, 0)])
def test_saturated_samples_are_no_readings(sensor: Icm20948, chip: Chip, raw: tuple[int, ...]) -> None:
    chip.fill(raw)
    assert "saturated" in reasons(cycle(sensor, chip, 1))[0]


def test_a_single_damaged_sample_is_refused_and_a_real_step_is_accepted(sensor: Icm20948, chip: Chip) -> None:
    chip.fill((0, 0, 0, 0, 0, 0), (1, 0, 8192, 0, 0, 0))
    outputs = cycle(sensor, chip, 1)
    assert [isinstance(one, Rejected) for one in outputs] == [True, False]
    chip.fill(*[(turn, 0, 0, 0, 0, 0) for turn in range(5)])
    outputs = cycle(sensor, chip, 2)
    assert [isinstance(one, Rejected) for one in outputs] == [True] * 3 + [False] * 2


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [-1, 1])
def test_every_axis_has_its_largest_step(sensor: Icm20948, chip: Chip, axis: int, sign: int) -> None:
    """5 m/s^2 at 8192 counts for g, 1 rad/s at 65.5 counts for a degree per second (data sheet, tables 1 and 2)."""
    largest = 5.0 / 9.80665 * 8192.0 if axis < 3 else math.degrees(1.0) * 65.5
    turning = (500, -700, 8192, 900, -1100, 1300)
    far, near = (list(turning) for _ in range(2))
    far[axis] += sign * round(1.02 * largest)
    near[axis] += sign * round(0.98 * largest)
    chip.fill(turning, tuple(far), tuple(near))
    assert reasons(cycle(sensor, chip, 1)) == ["leap: no vehicle moves like that"]


def test_a_damaged_sample_at_the_very_beginning_costs_itself_only(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    play(sensor.configure(), chip)
    chip.fill((0, 20_000, -8192, 0, 0, 0))
    chip.still(4)
    outputs = play(sensor.cycle(START), chip)
    assert [isinstance(one, Rejected) for one in outputs] == [True] + [False] * 4


def test_the_first_sample_is_as_far_from_the_second_as_from_any_other(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    play(sensor.configure(), chip)
    chip.fill((0, 0, 8192 + 4595, 0, 0, 0))  # 5.5 m/s^2
    chip.still(4)
    assert [type(one) for one in play(sensor.cycle(START), chip)] == [Rejected, *[Stamped] * 4]


def test_a_step_right_after_the_beginning_is_accepted_no_earlier_than_any_other(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    play(sensor.configure(), chip)
    chip.fill(LEVEL, LEVEL, *[(turn, 0, 0, 0, 0, 0) for turn in range(5)])
    assert [type(one) for one in play(sensor.cycle(START), chip)] == [Stamped] * 2 + [Rejected] * 3 + [Stamped] * 2


@pytest.mark.parametrize(("divider", "accepted"), [(4, False), (44, True)])
def test_what_a_step_may_be_follows_the_rate(chip: Chip, divider: int, accepted: bool) -> None:
    """20 m/s^2 in 40 ms is a vehicle that is set down, in 4 ms it is damage."""
    sensor = Icm20948(Icm20948Knobs(divider=divider, magnetometer=False))
    play(sensor.configure(), chip)
    chip.fill(LEVEL, (1, 0, 8192, 0, 0, 0), (0, 0, 8192 + 16706, 0, 0, 0))
    assert (reasons(cycle(sensor, chip, 1)) == []) is accepted


@pytest.mark.parametrize("axis", [2, 4])
def test_samples_that_burst_mode_has_skipped_widen_the_step(axis: int) -> None:
    ready = (WriteRead(0x68, b"\x1a", 1), b"\x01")
    for late_s, count, accepted in ((0.0045, 6266, False), (0.0045, 16706, False), (0.045, 16706, True)):
        sensor = Icm20948(Icm20948Knobs(mode="burst", magnetometer=False))
        raw = [*LEVEL]
        for at, step in ((START, 0), (after(START, late_s), count)):
            raw[axis] += step
            newest = (WriteRead(0x68, b"\x2d", 12), struct.pack(">6h", *raw))
            outputs = rehearse(sensor.cycle(at), [ready, newest])
        assert isinstance(outputs[0], Stamped) is accepted


def test_accelerometer_and_magnetometer_are_corrected_by_the_vehicle_file(chip: Chip) -> None:
    calibration = {"accel_offset_mps2": (0.1, 0.0, 0.0), "accel_scale": (1.0, 1.0, 0.5)}
    sensor = Icm20948(Icm20948Knobs(magnetometer=False), None, calibration)
    play(sensor.configure(), chip)
    chip.fill(LEVEL)
    (output,) = play(sensor.cycle(START), chip)
    assert isinstance(output.reading if isinstance(output, Stamped) else None, Inertial)
    assert output.reading.specific_force_mps2 == pytest.approx((-0.1, 0.0, 0.5 * 9.80665))  # type: ignore[union-attr]


def test_a_calibration_of_the_wrong_length_names_its_key() -> None:
    with pytest.raises(UsageError, match=r"calibration.mag_matrix: found 3 values, wanted 9"):
        Icm20948(calibration={"mag_matrix": (1.0, 1.0, 1.0)})


def test_a_period_that_overfills_the_fifo_is_refused() -> None:
    with pytest.raises(UsageError, match=r"imu: period_s: found 0.2, wanted at most 0.114 at 225 Hz"):
        build(Icm20948Knobs, {"period_s": 0.2}, "imu")


def test_burst_mode_reads_the_newest_sample_when_there_is_one() -> None:
    sensor = Icm20948(Icm20948Knobs(mode="burst", magnetometer=False))
    assert sensor.period_s == pytest.approx(1 / 225)
    ready = (WriteRead(0x68, b"\x1a", 1), b"\x01")
    none = (WriteRead(0x68, b"\x1a", 1), b"\x00")
    newest = (WriteRead(0x68, b"\x2d", 12), struct.pack(">6h", *LEVEL))
    assert list(rehearse(sensor.cycle(START), [none])) == []
    (output,) = rehearse(sensor.cycle(START), [ready, newest])
    half_a_period_s = 0.5 / 225.0
    assert output.stamp == pytest.approx(after(START, -half_a_period_s - Icm20948Knobs().filter_delay_s), abs=1)


def test_burst_mode_uses_no_data_ready_line(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(mode="burst", data_ready="chip:1", magnetometer=False))
    identity = play(sensor.configure(), chip)
    assert "timed" not in identity.text
    assert all(address == 0x68 for address, _ in chip.asked)


def test_a_line_that_has_no_number_is_refused() -> None:
    with pytest.raises(UsageError, match="imu: data_ready: found 'chip'"):
        build(Icm20948Knobs, {"data_ready": "chip"}, "imu")


def test_field_and_temperature_are_read_in_every_so_many_th_turn(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(period_s=0.03, magnetometer_every=3, temperature_every=2))
    assert sensor.period_s == 0.03
    for _ in range(2):
        play(sensor.configure(), chip)
        fields, temperatures = [], []
        for turn in range(1, 8):
            chip.still(4)
            chip.asked.clear()
            outputs = cycle(sensor, chip, turn)
            assert len(outputs) == 4 + (turn % 3 == 0)
            fields += [turn] * sum(isinstance(one, Stamped) and isinstance(one.reading, Magnetic) for one in outputs)
            temperatures += [turn] * ((0x68, 0x39) in chip.asked)
        assert (fields, temperatures) == ([3, 6], [2, 4, 6])


def test_samples_that_came_together_are_apart_by_the_period_that_was_found(chip: Chip) -> None:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False))
    play(sensor.configure(), chip)
    period_s = 1.04 / 225.0  # the clock of the sensor is slow
    for turn in range(1500):
        chip.still(4)
        outputs = play(sensor.cycle(after(START, 4 * turn * period_s)), chip)
    steps = [(b.stamp - a.stamp) / 1e9 for a, b in pairwise(outputs)]
    assert steps == pytest.approx([period_s] * 3, rel=1e-3)


def test_burst_mode_bears_turns_without_a_new_sample_but_not_a_quarter_of_a_second_of_them() -> None:
    sensor = Icm20948(Icm20948Knobs(mode="burst", magnetometer=False))
    none, ready = ((WriteRead(0x68, b"\x1a", 1), answer) for answer in (b"\x00", b"\x01"))
    for turn in range(40):
        newest = (WriteRead(0x68, b"\x2d", 12), struct.pack(">6h", turn, 0, 8192, 0, 0, 0))
        rehearse(sensor.cycle(after(START, 0.02 * turn)), [none] if turn % 2 else [ready, newest])
    with pytest.raises(DeviceError, match=r"no sample for 0.25 s"):
        rehearse(sensor.cycle(after(START, 0.76 + 0.26)), [none])


@pytest.mark.parametrize(
    ("ordered", "end"), [(None, "g, timed by line 3 of chip"), ("other:4", "g, timed by line 4 of other"), ("", "4 g")]
)
def test_the_line_of_the_vehicle_file_times_the_samples_unless_another_is_ordered(
    vehicle: Vehicle, chip: Chip, ordered: str | None, end: str
) -> None:
    mount = replace(vehicle.sensors["icm20948"], data_ready="chip:3")
    sensor = DRIVER.make(Icm20948Knobs(data_ready=ordered, magnetometer=False), mount, vehicle)
    identity = play(sensor.configure(), chip)
    assert identity.text.endswith(end)


SET_UP: list[tuple[Operation, bytes | DeviceError]] = [
    (Write(0x0C, b"\x32\x01"), b""),
    (Pause(0.001), b""),
    (WriteRead(0x0C, b"\x00", 2), b"\x48\x09"),
    (Write(0x0C, b"\x31\x08"), b""),
]
BLOCK = WriteRead(0x0C, b"\x10", 9)
NACK = DeviceError("no acknowledge")


def test_a_magnetometer_that_fails_does_not_take_the_rest_with_it_and_comes_back() -> None:
    mag = Ak09916(Correction())
    assert rehearse(mag.configure(), [(SET_UP[0][0], NACK)]) == "no AK09916 (no acknowledge)"
    (reported,) = rehearse(mag.read(START), [(SET_UP[0][0], NACK)])
    assert reported == Rejected(START, "magnetometer: no AK09916 (no acknowledge)")
    assert list(rehearse(mag.read(after(START, 0.04)), [])) == []
    assert list(rehearse(mag.read(after(START, SET_UP_EVERY_S)), SET_UP)) == []
    (reading,) = rehearse(mag.read(after(START, 1.1)), [(BLOCK, b"\x01\x01\0\0\0\0\0\0\0")])
    assert isinstance(reading, Stamped)
    (lost,) = rehearse(mag.read(after(START, 1.2)), [(BLOCK, NACK)])
    assert isinstance(lost, Rejected)


def test_a_magnetometer_that_hangs_is_set_up_again() -> None:
    mag = Ak09916(Correction())
    rehearse(mag.configure(), SET_UP)
    same = [(BLOCK, b"\x01\x05\0\x06\0\x07\0\0\0")]
    outputs = [rehearse(mag.read(after(START, 0.04 * turn)), same)[0] for turn in range(MAG_REPEATS + 1)]
    assert "equal samples" in outputs[-1].reason  # type: ignore[union-attr]
    rehearse(mag.configure(), SET_UP)
    assert list(rehearse(mag.read(START), [(BLOCK, bytes(9))])) == []
    (silent,) = rehearse(mag.read(Stamp(START + 600_000_000)), [(BLOCK, bytes(9))])
    assert "no sample for 0.5 s" in silent.reason  # type: ignore[union-attr]


def test_a_magnetometer_that_pauses_now_and_then_is_received() -> None:
    mag = Ak09916(Correction())
    rehearse(mag.configure(), SET_UP)
    for turn in range(10):
        block = bytes(9) if turn % 2 else b"\x01" + struct.pack("<3h", turn, 0, 50) + bytes(2)
        outputs = rehearse(mag.read(after(START, 0.3 * turn)), [(BLOCK, block)])
        assert [type(one) for one in outputs] == ([] if turn % 2 else [Stamped])


def test_a_turn_between_two_fields_that_lie_far_apart_is_accepted() -> None:
    for span_s, accepted in ((0.04, False), (0.2, True)):
        mag = Ak09916(Correction())
        rehearse(mag.configure(), SET_UP)
        north, east = (b"\x01" + struct.pack("<3h", *field) + bytes(2) for field in ((200, 0, 50), (0, 200, 50)))
        rehearse(mag.read(START), [(BLOCK, north)])
        (output,) = rehearse(mag.read(after(START, span_s)), [(BLOCK, east)])
        assert isinstance(output, Stamped) is accepted


def magnetometer() -> Ak09916:
    mag = Ak09916(Correction())
    assert rehearse(mag.configure(), SET_UP) == "AK09916"
    return mag


def field(mag: Ak09916, at_s: float, *counts: int) -> Any:
    """What becomes of a sample."""
    (output,) = rehearse(mag.read(after(START, at_s)), [(BLOCK, b"\x01" + struct.pack("<3h", *counts) + bytes(2))])
    return output


def test_a_field_is_as_old_as_half_a_period_and_half_a_measurement() -> None:
    """100 Hz, 7.2 ms for a measurement (AK09916 data sheet, section 5.3)."""
    assert field(magnetometer(), 0.0, 1, 2, 3).stamp == START - 8_600_000


@pytest.mark.parametrize("axis", range(3))
def test_a_leap_is_refused_until_it_is_confirmed_and_noise_on_a_strong_field_is_none(axis: int) -> None:
    mag = magnetometer()
    strong, noisy, far = ([300, -300, 50] for _ in range(3))
    noisy[axis] += 20
    far[axis] += 400
    taken = [isinstance(field(mag, 0.04 * turn, *(noisy if turn % 2 else strong)), Stamped) for turn in range(4)]
    assert taken == [True] * 4
    leaps = [type(field(mag, 0.16 + 0.001 * turn, *far)) for turn in range(5)]
    assert leaps == [Rejected] * 3 + [Stamped] * 2
    assert isinstance(field(mag, 0.166, *strong), Rejected), "the next leap is doubted anew"


def test_what_was_accepted_before_a_set_up_is_forgotten() -> None:
    mag = magnetometer()
    for turn in range(MAG_REPEATS):
        assert isinstance(field(mag, 0.01 * turn, 300, 0, 0), Stamped)
    far = [field(mag, 0.2 + 0.001 * turn, -300, 0, 0) for turn in range(2)]
    assert [type(one) for one in far] == [Rejected, Rejected]
    rehearse(mag.configure(), SET_UP)
    assert isinstance(field(mag, 0.2, -300, 0, 0), Stamped)
    assert [type(field(mag, 0.201, 300, 0, turn)) for turn in range(4)] == [Rejected] * 3 + [Stamped]


def test_a_magnetometer_that_is_not_found_again_is_not_read() -> None:
    rehearse(Ak09916(Correction()).read(START), SET_UP)
    mag = magnetometer()
    rehearse(mag.configure(), [(SET_UP[0][0], NACK)])
    rehearse(mag.read(START), SET_UP)
    assert isinstance(field(mag, 0.01, 1, 2, 3), Stamped)


def test_a_lost_magnetometer_is_set_up_again_once_a_second_and_when_the_clock_went_back() -> None:
    mag = magnetometer()
    (lost,) = rehearse(mag.read(START), [(BLOCK, NACK)])
    assert lost == Rejected(START, "magnetometer: no acknowledge")
    for late_s in (0.0, 0.99):
        assert list(rehearse(mag.read(after(START, late_s)), [])) == []
    (reported,) = rehearse(mag.read(after(START, 1.0)), [(SET_UP[0][0], NACK)])
    assert reported == Rejected(after(START, 1.0), "magnetometer: no AK09916 (no acknowledge)")
    assert list(rehearse(mag.read(after(START, 1.99)), [])) == []
    assert list(rehearse(mag.read(after(START, 0.5)), SET_UP)) == []


def test_another_chip_in_place_of_the_magnetometer_is_named() -> None:
    mag = Ak09916(Correction())
    assert "found identity 4800, wanted 4809" in rehearse(mag.configure(), [*SET_UP[:2], (SET_UP[2][0], b"\x48\x00")])


PERIOD_ns = 4_000_000


def test_the_clock_of_edges_goes_by_the_edge_of_each_sample() -> None:
    clock = EdgeClock(0.98 * PERIOD_ns)
    assert clock.map(4, (7, 7 * PERIOD_ns)) is None, "nobody knows yet which edge belongs to which sample"
    for ticks in (8, 12, 17):
        assert clock.map(ticks, (ticks + 3, (ticks + 3) * PERIOD_ns)) == (ticks + 3) * PERIOD_ns
    assert clock.period_ns == PERIOD_ns


@pytest.mark.parametrize("ahead", [2, 4])
def test_an_edge_lost_or_of_something_else_times_nothing_until_the_next_confirms_the_count(ahead: int) -> None:
    clock = EdgeClock(PERIOD_ns)
    for ticks in (4, 8):
        clock.map(ticks, (ticks + 3, (ticks + 3) * PERIOD_ns))
    assert clock.map(12, (12 + ahead, 0)) == 15 * PERIOD_ns
    assert clock.map(16, None) == 19 * PERIOD_ns, "a sample came while the FIFO was read"
    assert clock.map(20, (20 + ahead, 23 * PERIOD_ns + 1000)) == 23 * PERIOD_ns + 1000


def test_without_edges_the_clock_of_edges_soon_states_nothing() -> None:
    clock = EdgeClock(PERIOD_ns)
    for ticks in (4, 8):
        clock.map(ticks, (ticks, ticks * PERIOD_ns))
    assert clock.map(60, None) == 60 * PERIOD_ns
    assert clock.map(80, None) is None


def test_a_step_of_the_host_s_clock_is_not_a_period() -> None:
    clock = EdgeClock(PERIOD_ns)
    for ticks in (4, 8):
        clock.map(ticks, (ticks, ticks * PERIOD_ns))
    assert clock.map(12, (12, 12 * PERIOD_ns - 10**9)) == 12 * PERIOD_ns - 10**9
    assert clock.period_ns == PERIOD_ns


@pytest.mark.parametrize(("share", "accepted"), [(0.89, False), (0.91, True), (1.09, True), (1.11, False)])
def test_a_period_is_the_nominal_one_within_a_tenth(share: float, accepted: bool) -> None:
    clock = EdgeClock(PERIOD_ns)
    for ticks in (4, 8, 12):
        clock.map(ticks, (ticks, round(share * ticks * PERIOD_ns)))
    assert clock.period_ns == pytest.approx((share if accepted else 1.0) * PERIOD_ns)


def edges(count: int, newest_s: float) -> bytes:
    return struct.pack(">Iq", count, round(1e9 * newest_s))


def timed_cycle(sensor: Icm20948, at: Stamp, before: bytes, behind: bytes, turn: int) -> Any:
    """Four samples between two looks at the line."""
    line, count, burst = Read(0x81, 12), WriteRead(0x68, b"\x70", 2), WriteRead(0x68, b"\x72", 48)
    data = b"".join(struct.pack(">6h", turn, index, 8192, 1, 2, 3) for index in range(4))
    return rehearse(sensor.cycle(at), [(line, before), (count, b"\x00\x30"), (burst, data), (line, behind)])


def timed_sensor() -> Icm20948:
    sensor = Icm20948(Icm20948Knobs(data_ready="chip:1", magnetometer=False, temperature_every=100))
    play(sensor.configure(), Chip())
    return sensor


def test_a_line_without_edges_is_reported_four_times_a_second() -> None:
    sensor, reported_s = timed_sensor(), []
    for turn in range(56):
        at_s = 1.0 + turn / 50.0
        reported = reasons(timed_cycle(sensor, stamp_from_s(at_s), bytes(12), bytes(12), turn))
        assert reported == [SILENT_LINE] * len(reported)
        reported_s += [at_s] * len(reported)
    assert reported_s == pytest.approx([1.26, 1.52, 1.78, 2.04])


def test_a_line_that_times_the_samples_is_never_given() -> None:
    sensor = timed_sensor()
    for turn in range(1, 40):
        look = edges(4 * turn, 1.0 + 4 * turn / 225.0)
        assert reasons(timed_cycle(sensor, stamp_from_s(1.001 + 4 * turn / 225.0), look, look, turn)) == []


DELAY_ns = round(1e9 * Icm20948Knobs().filter_delay_s)


@pytest.mark.parametrize(("late_s", "used"), [(0.0045, True), (0.0052, False), (-0.0045, True), (1.0, False)])
def test_an_edge_further_from_the_look_than_a_period_is_not_that_of_the_newest_sample(
    late_s: float, used: bool
) -> None:
    """A period of 4.44 ms, and a tenth."""
    sensor = timed_sensor()
    for turn, at_s in ((1, 0.999), (2, 1.017)):
        timed_cycle(sensor, stamp_from_s(at_s + 0.001), edges(4 * turn, at_s), edges(4 * turn, at_s), turn)
    (*_, newest) = timed_cycle(sensor, stamp_from_s(1.035 + late_s), edges(12, 1.035), edges(12, 1.035), 3)
    wanted_ns = 1_035_000_000 if used else 1_017_000_000 + 4e9 / 225.0
    assert newest.stamp == pytest.approx(wanted_ns - DELAY_ns, abs=1)


def test_samples_after_an_overflow_are_timed_anew() -> None:
    sensor = timed_sensor()
    for turn in range(1, 5):
        look = edges(4 * turn, 1.0 + 4 * turn / 225.0)
        timed_cycle(sensor, stamp_from_s(1.001 + 4 * turn / 225.0), look, look, turn)
    emptied: list[tuple[Operation, bytes]] = [
        (Read(0x81, 12), edges(70, 1.3)),
        (WriteRead(0x68, b"\x70", 2), b"\x02\x00"),
        (Write(0x68, b"\x68\x1f"), b""),
        (Write(0x68, b"\x68\x00"), b""),
    ]
    assert "overflow" in reasons(rehearse(sensor.cycle(stamp_from_s(1.3)), emptied))[0]
    (*_, newest) = timed_cycle(sensor, stamp_from_s(1.32), edges(74, 1.319), edges(74, 1.319), 6)
    assert newest.stamp == stamp_from_s(1.32) - DELAY_ns


def test_an_edge_between_two_looks_is_not_that_of_the_newest_sample_in_the_burst() -> None:
    sensor = timed_sensor()
    start, later = stamp_from_s(1.0), stamp_from_s(1.018)
    first = timed_cycle(sensor, start, edges(4, 0.999), edges(4, 0.999), 1)
    assert reasons(first) == []
    (*_, newest) = timed_cycle(sensor, later, edges(8, 1.017), edges(8, 1.017), 2)
    assert newest.stamp == 1_017_000_000 - DELAY_ns
    (*_, newest) = timed_cycle(sensor, stamp_from_s(1.037), edges(12, 1.0348), edges(13, 1.0393), 3)
    assert newest.stamp == pytest.approx(1_017_000_000 + 4e9 / 225.0 - DELAY_ns, abs=1)
    (*_, newest) = timed_cycle(sensor, stamp_from_s(1.054), edges(16, 1.053), edges(16, 1.053), 4)
    assert newest.stamp == 1_053_000_000 - DELAY_ns, "the next one counts again"
