"""Recorded wires as hardware: in step, out of step, before the record and behind it, and under the real drivers."""

from pathlib import Path

import pytest
import yaml

from hindrax_bag.read.bag_reader import attachments, messages
from hindrax_core.bus_operations import Read, Transaction, Write, WriteRead, pack_transaction, wire_error
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, Stamped
from hindrax_core.knobs import build
from hindrax_core.readings import Pressure
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.driver_registry import driver_of
from hindrax_sim.devices.emulator import NackError
from hindrax_sim.recorded_hardware import RecordedHardware, RecordedLine, RecordedPart, recorded_frames

MS = 1_000_000
BAG = Path(__file__).parent / "bags" / "surge"
START, RESULT = Write(0x76, b"\x48"), WriteRead(0x76, b"\x00", 3)
OTHER = Write(0x76, b"\x58")


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return build(Vehicle, yaml.safe_load(attachments(BAG)["vehicle.yaml"]), "vehicle.yaml:")


def part(cycles: int = 50) -> RecordedPart:
    """Cycles of 20 ms: one quantity, its result, another, its result."""
    made = RecordedPart()
    steps: list[tuple[Transaction, bytes]] = [(START, b""), (RESULT, b"p%02d"), (OTHER, b""), (RESULT, b"t%02d")]
    for index in range(cycles):
        for step, (asked, answer) in enumerate(steps):
            made.add((20 * index + 5 * step) * MS, asked, answer % index if answer else answer)
    return made


def cycle(made: RecordedPart, at_ms: float) -> list[bytes]:
    asked: tuple[Transaction, ...] = (START, RESULT, OTHER, RESULT)
    return [made.answer(one, round((at_ms + 5 * step) * MS)) for step, one in enumerate(asked)]


def test_a_host_in_step_gets_every_answer_once() -> None:
    made = part()
    found = [answer for index in range(50) for answer in cycle(made, 20 * index + 4)]
    assert found == list(part().answers)


def test_a_host_that_comes_late_goes_on_in_the_present_and_mixes_nothing_up() -> None:
    made = part()
    cycle(made, 0.0)
    assert cycle(made, 400.0) == [b"", b"p20", b"", b"t20"]
    assert cycle(made, 421.0) == [b"", b"p21", b"", b"t21"]


def test_a_small_lead_or_lag_skips_and_repeats_nothing() -> None:
    made = part()
    offsets = [0.0, 12.0, -9.0, 20.0, -15.0]
    found = [cycle(made, 20 * (index + 2) + off)[1] for index, off in enumerate(offsets)]
    assert found == [b"p%02d" % (index + 2) for index in range(5)]


def test_nobody_answers_before_the_record_behind_it_or_to_what_was_never_asked() -> None:
    made = part()
    for asked, now in ((START, -1), (START, 60_000 * MS), (Read(0x76, 7), 5)):
        with pytest.raises(NackError):
            made.answer(asked, now)


def test_a_line_states_its_bytes_when_their_time_has_come() -> None:
    line = RecordedLine([(10, b"a"), (20, b"bc"), (21, b"d")])
    assert [line.read_until(stamp) for stamp in (5, 10, 20, 30, 40)] == [b"", b"a", b"bc", b"d", b""]
    assert line.receive(b"question", 1.0) == b""


def test_without_wire_frames_there_is_no_hardware(vehicle: Vehicle) -> None:
    with pytest.raises(UsageError, match="holds no wire frames"):
        RecordedHardware(vehicle, {"thrusters": [(1, 1, pack_transaction(START))]})


def test_the_real_driver_reads_the_recorded_part(vehicle: Vehicle) -> None:
    hardware = RecordedHardware(vehicle, recorded_frames(BAG, vehicle))
    mount = vehicle.sensors["ms5837"]
    row = driver_of(mount.device)
    schedule, now = BusSchedule(), hardware.stamp
    schedule.add("ms5837", row.make(row.knobs(), mount, vehicle), now)

    def transfer(transaction: Transaction) -> bytes:
        try:
            return hardware.i2c.transfer(transaction, now)
        except OSError as error:
            raise wire_error("i2c", transaction.address, error.errno or 0) from error

    found = []
    end = Stamp(hardware.stamp + 10_000 * MS)
    while now < end:
        now = Stamp(max(now + 1, schedule.next_due(now)))
        found += [one for _, outputs in schedule.step(now, transfer) for one in outputs]
    read = [one.reading.pressure_Pa for one in found if isinstance(one, Stamped) and isinstance(one.reading, Pressure)]
    recorded = [one.decoded().fluid_pressure for one in messages(BAG, {"/hindrax/ms5837/pressure"})]
    assert len(read) > 450
    # The node of that day published from when it was active.
    assert any(read[first : first + 400] == recorded[10:410] for first in range(60))
