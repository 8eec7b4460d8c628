"""The contract of every sensor of the table: truth in, the same truth out, through every fault that it can suffer."""

import functools
import random
from collections import Counter
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
from contract.plugged import Plugged, mount_of
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.events import Stamp
from hindrax_core.readings import DeviceText
from hindrax_core.sensor_table import SENSORS, Sensor, all_sensors, unusable_sensors
from hindrax_core.testing import chunks
from hindrax_drivers.driver_registry import driver_of
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec
from hindrax_sim.hardware import emulator_of

GOLDEN = Path(__file__).parents[1] / "golden"
BEGIN_S, LASTS_S, BACK_WITHIN_S, AFTER_S = 4.0, 3.0, 2.0, 1.0
OVER_S = BEGIN_S + LASTS_S
MID_CYCLE_S = BEGIN_S + 0.005
"""In a conversion: between two of them a part that loses its power for a moment does no harm and is not reported."""
WITHOUT_POWER = {"reset", "wrong_identity"}
EVERY = all_sensors()
"""Also those of installed packages, so that their authors can hold them to the contract."""
NAMES = [sensor.name for sensor in EVERY]
SWEEP = [
    (sensor.name, fault)
    for sensor in EVERY
    for fault, kind in FAULTS.items()
    if kind.falls_on(sensor) and (kind.make or kind.on_bus)
]
QUIET = {"bytewise", "merged", "unplug_replug"}
"""Faults the driver has nothing to say of: the time of arrival alone changes, or the owner of the port tells it."""
EVERYWHERE = {"absent", "wrong_identity", "reset"}
FAULTS_OF = {
    "serial": EVERYWHERE
    | {"cut_frames", "bytewise", "merged", "garbage", "bit_flips", "baud_mismatch", "unplug_replug"}
    | {"saturated", "repeated"},
    "i2c": EVERYWHERE | {"nack", "bus_stuck", "short_read", "bit_flips", "saturated", "repeated"},
    "gpio": EVERYWHERE | {"nack"},
}
"""By wire. A line of a GPIO chip has one bit: it comes whole, has no scale, and is the same for years."""
HEALTHY = "no fault"
RARE_S = {"bit_flips": 30.0}
"""Duration in which also a slow sensor is hit by a fault that hits few of its bits; asked where 3 s did no harm."""
BUS = "let the errors of the bus pass: who owns it reports them, and configures the device again"
MARKS = "find begin and end of a message by its own marks, never by when its bytes arrive"
VERIFIED = "reject what has the wrong length or checksum, and what is no number of the data sheet"
REMEDY = {
    "absent": "report silence as a Trouble, once (`SilenceMonitor`)",
    "wrong_identity": "compare what the device says of itself with the data sheet: DeviceError, or Trouble on a line",
    "nack": BUS,
    "bus_stuck": BUS,
    "short_read": BUS,
    "cut_frames": VERIFIED,
    "bytewise": MARKS,
    "merged": MARKS,
    "garbage": VERIFIED,
    "bit_flips": "reject by the checksum; without one read twice and compare as closely as the noise allows",
    "baud_mismatch": "report bytes of which none verifies as a Trouble (`last_valid` of `SilenceMonitor`)",
    "unplug_replug": "begin anew in `start`, and let the device boot before its silence is reported",
    "reset": "find a restart by lost settings, by a counter that begins anew, or by the silence of its start",
    "clock_jump": "map the clock of the device to the time of arrival anew where it steps (`Timebase`)",
    "saturated": "reject the end of the scale (RejectCode.RANGE, END_OF_SCALE)",
    "repeated": "reject a measurement that comes again: the same counter, or none of the noise (RejectCode.REPEATED)",
}
"""What a driver does about each fault."""


def kinds(plugged: Plugged, since_s: float, until_s: float) -> Counter[type]:
    """How many readings of each kind there were; texts come when they like."""
    found = Counter(type(one.reading) for one in plugged.readings(since_s, until_s))
    del found[DeviceText]
    return found


def _reads(plugged: Plugged, since_s: float, until_s: float) -> None:
    """Readings come; where not, say what was said instead."""
    told = plugged.complaints(since_s, until_s)[:3] or plugged.complaints()[-3:]
    assert kinds(plugged, since_s, until_s), (
        f"no reading from {since_s:g} to {until_s:g} s, with a healthy device; the driver said {told or 'nothing'}:"
        " check period, set-up, and what it refuses"
    )


def _is_content(plugged: Plugged, until_s: float = 1e9) -> None:
    """Nothing is complained of while nothing is wrong."""
    told = plugged.complaints(until_s=until_s)
    assert not told, (
        f"complains without a fault: {told[:3]}; check limits and patience of the driver against the data sheet"
    )


def _runs(plugged: Plugged, seconds: float, fault: str = HEALTHY) -> None:
    """Let time pass; the driver raises nothing but a DeviceError, which the owner of the bus takes."""
    try:
        plugged.run(seconds)
    except Exception as error:
        remedy = REMEDY.get(fault, "check it against the golden cases")
        raise AssertionError(
            f"{fault}: the driver ended with {error!r}, wanted a Rejected or Trouble: {remedy}"
        ) from error


def _is_true(plugged: Plugged, fault: str = HEALTHY) -> None:
    """No reading is false."""
    found = plugged.false()
    if found and plugged.seconds(found[0]) < BEGIN_S:
        fault = HEALTHY
    remedy = REMEDY.get(fault, "look at scale, unit and sign, and at the time of the stamp")
    assert not found, (
        f"{fault}: {len(found)} false readings, such as {plugged.beside_the_truth(found[0])}: {remedy};"
        " or widen `agrees` of the emulator to the accuracy of the data sheet"
    )


def fresh(name: str) -> Any:
    """The driver as it is when its port has just been opened."""
    vehicle, mount = mount_of(name)
    row = driver_of(name)
    driver = row.make(row.knobs(), mount, vehicle)
    list(driver.start(Stamp(0)))
    return driver


@functools.cache
def recorded(name: str) -> bytes:
    """What a serial sensor says in some seconds, once its driver has set it up."""
    plugged = Plugged(name)
    plugged.run(4.0)
    return plugged.received()


@pytest.mark.parametrize("name", [sensor.name for sensor in SENSORS])
def test_golden_cases_are_there(name: str) -> None:
    wanted = f"wanted test/golden/{name}/cases.yaml, and a test_*.py beside it that holds the driver against it"
    assert list((GOLDEN / name).glob("test_*.py")), wanted
    assert (GOLDEN / name / "cases.yaml").exists(), wanted


@pytest.mark.parametrize("name", [*NAMES, *unusable_sensors()])
def test_its_row_driver_and_emulator_can_be_loaded(name: str) -> None:
    assert name in NAMES, unusable_sensors()[name]
    driver_of(name)
    emulator_of(name)


@pytest.mark.parametrize("sensor", EVERY, ids=lambda sensor: sensor.name)
def test_every_fault_of_its_wire_falls_on_it(sensor: Sensor) -> None:
    left_out = FAULTS_OF[sensor.wire] - {fault for name, fault in SWEEP if name == sensor.name}
    assert not left_out, (
        f"no fault {', '.join(sorted(left_out))} falls on a {sensor.wire} sensor: see fault_registry.py"
    )
    assert REMEDY.keys() >= {fault for name, fault in SWEEP if name == sensor.name}


@pytest.mark.parametrize("name", NAMES)
def test_a_truth_that_is_reported_is_read(name: str) -> None:
    @settings(max_examples=5, deadline=None)
    @given(st.floats(0.0, 60.0))
    def still(seconds: float) -> None:
        truth = emulator_of(name).example(seconds)
        plugged = Plugged(name, truth=lambda _: truth)
        _runs(plugged, 2.5)
        _reads(plugged, 1.5, 2.5)
        _is_content(plugged)
        _is_true(plugged)

    still()


@pytest.mark.parametrize("name", [sensor.name for sensor in EVERY if sensor.serial])
def test_the_same_bytes_say_the_same_however_they_are_cut(name: str) -> None:
    stream = recorded(name)
    whole = [fresh(name).feed(stream, Stamp(10**9))]

    @settings(max_examples=20, deadline=None)
    @given(st.lists(st.integers(1, 200), min_size=1, max_size=8))
    def cut(sizes: list[int]) -> None:
        driver = fresh(name)
        pieces = [driver.feed(piece, Stamp(10**9)) for piece in chunks(stream, sizes)]
        found, wanted = list(chain.from_iterable(pieces)), list(chain.from_iterable(whole))
        assert found == wanted, (
            f"the same bytes in pieces of {sizes} gave {len(found)} outputs, in one piece {len(wanted)}: `feed` keeps"
            " the begin of a message until its rest comes"
        )

    cut()


@pytest.mark.parametrize("name", [sensor.name for sensor in EVERY if sensor.serial])
def test_damaged_bytes_never_end_in_an_exception(name: str) -> None:
    stream, dice = recorded(name), random.Random(name)
    driver = fresh(name)
    for turn in range(300):
        at = dice.randrange(len(stream))
        piece = bytearray(stream[at : at + dice.randrange(1, 400)])
        for _ in range(dice.randrange(4)):
            piece[dice.randrange(len(piece))] = dice.randrange(256)
        try:
            list(driver.feed(bytes(piece), Stamp(10**9 + turn * 10**7)))
            list(driver.tick(Stamp(10**9 + turn * 10**7)))
        except Exception as error:
            raise AssertionError(f"{bytes(piece)!r} ended in {error!r}, wanted a Rejected: {VERIFIED}") from error


@pytest.mark.parametrize("name", NAMES)
def test_a_truth_that_moves_is_read_as_it_was_at_the_stamp(name: str) -> None:
    plugged = Plugged(name)
    _runs(plugged, 10.0)
    found = plugged.identities()
    assert len(found) == 1, (
        f"identified {len(found)} times in 10 s ({found}), wanted once: after `configure`, or `start`"
    )
    _reads(plugged, 5.0, 10.0)
    _is_content(plugged)
    _is_true(plugged)


TIMED = [("icm20948", fault, {"data_ready": "pinctrl-bcm2711:17"}) for fault in ("bit_flips", "reset")]
"""The inertial sensor once more, with its data-ready line: when bytes are wrong, and when the line falls silent."""


@pytest.mark.parametrize(("name", "fault", "wired"), [*((*one, {}) for one in SWEEP), *TIMED])
def test_a_fault_is_survived_given_and_over_when_it_is_over(name: str, fault: str, wired: dict[str, Any]) -> None:
    begin_s = MID_CYCLE_S if fault in WITHOUT_POWER else BEGIN_S
    plugged = Plugged(name, [FaultSpec(fault, (name,), begin_s, LASTS_S)], **wired)
    _runs(plugged, OVER_S + BACK_WITHIN_S + AFTER_S, fault)
    before = kinds(plugged, BEGIN_S - AFTER_S, BEGIN_S)
    _reads(plugged, BEGIN_S - AFTER_S, BEGIN_S)
    _is_content(plugged, until_s=BEGIN_S)
    _is_true(plugged, fault)
    reported = plugged.complaints(BEGIN_S, OVER_S + BACK_WITHIN_S)
    if fault in QUIET:
        assert not reported, (
            f"{fault} ({FAULTS[fault].meaning}) is no fault of the device, and the driver complains: {reported[:3]};"
            f" {REMEDY[fault]}"
        )
    else:
        lasted_s = LASTS_S if reported else RARE_S.get(fault, LASTS_S)
        if lasted_s > LASTS_S:
            longer = Plugged(name, [FaultSpec(fault, (name,), begin_s, lasted_s)], **wired)
            _runs(longer, BEGIN_S + lasted_s + BACK_WITHIN_S, fault)
            _is_true(longer, fault)
            told = longer.complaints(BEGIN_S)
        else:
            told = reported
        assert told, (
            f"{fault} ({FAULTS[fault].meaning}) lasted {lasted_s:g} s and was not reported within"
            f" {lasted_s + BACK_WITHIN_S:g} s of its beginning: {REMEDY[fault]}"
        )
    back = kinds(plugged, OVER_S + BACK_WITHIN_S, OVER_S + BACK_WITHIN_S + AFTER_S)
    for kind, count in before.items():
        assert back[kind] >= 0.6 * count, (
            f"{kind.__name__}: {back[kind]} readings in a second, {BACK_WITHIN_S:g} s after {fault} was over, and"
            f" {count} before it: the driver must find it again by itself, and set it up anew (it said: {reported[:3]})"
        )
    for kind in before:
        stamps = [one.stamp for one in plugged.readings() if isinstance(one.reading, kind)]
        assert stamps == sorted(stamps), f"{kind.__name__}: stamps go back; never give one before the last"


@pytest.mark.parametrize("name", NAMES)
def test_a_sensor_that_is_absent_from_the_start_is_found_when_it_comes(name: str) -> None:
    plugged = Plugged(name, [FaultSpec("absent", (name,), 0.0, LASTS_S)])
    plugged.run(LASTS_S + BACK_WITHIN_S + AFTER_S)
    told = plugged.complaints(until_s=LASTS_S)
    assert told, (
        f"absent for {LASTS_S:g} s from the start, and nothing was reported: a Trouble is wanted, or a DeviceError"
    )
    _reads(plugged, LASTS_S + BACK_WITHIN_S, 1e9)


@pytest.mark.parametrize("name", NAMES)
def test_a_long_fault_is_not_given_again_and_again(name: str) -> None:
    plugged = Plugged(name, [FaultSpec("wrong_identity", (name,), MID_CYCLE_S, 12.0)])
    plugged.run(BEGIN_S + 12.0)
    count = len(plugged.troubles())
    assert 0 < count <= 20, (
        f"another device for 12 s: reported {count} times, wanted once, and again at most every second"
    )


@pytest.mark.parametrize("name", NAMES)
def test_several_faults_at_once(name: str) -> None:
    mine = [fault for sensor, fault in SWEEP if sensor == name]
    chosen = [fault for fault in ("garbage", "nack", "bit_flips", "short_read", "bytewise", "reset") if fault in mine]
    plugged = Plugged(name, [FaultSpec(fault, (name,), BEGIN_S, LASTS_S) for fault in chosen])
    plugged.run(OVER_S + BACK_WITHIN_S + AFTER_S)
    _is_true(plugged)
    _reads(plugged, OVER_S + BACK_WITHIN_S, 1e9)
