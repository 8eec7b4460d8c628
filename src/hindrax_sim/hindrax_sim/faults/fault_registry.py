"""Registry of faults: names for `--fault`, the devices of each, and the syntax.

`garbage:dvl75@30+5` is the fault garbage on the device dvl75, from 30 s on, for 5 s. Without a device it falls on
every device it applies to; without a time it comes after 10 s; without a duration it lasts 5 s.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from hindrax_core.errors import UsageError
from hindrax_core.sensor_table import SENSORS
from hindrax_sim.devices.emulator import RegisterEmulator, SerialEmulator
from hindrax_sim.faults import bus_faults as bus
from hindrax_sim.faults import stream_faults as line
from hindrax_sim.faults import truth_faults as truth
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled
from hindrax_sim.world import World

FaultT = TypeVar("FaultT")
SERIAL = tuple(sensor.name for sensor in SENSORS if sensor.serial)
SENSORS_I2C = tuple(sensor.name for sensor in SENSORS if sensor.wire == "i2c")
GPIO = tuple(sensor.name for sensor in SENSORS if sensor.wire == "gpio")
I2C = (*SENSORS_I2C, "thrusters")
THRUSTERS = tuple(f"T{number}" for number in range(1, 9))
DEFAULT_START_S, DEFAULT_DURATION_S = 10.0, 5.0
FORM = "NAME[:DEVICE][@START[+SECONDS]], such as garbage:dvl75@30+5"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A row of the registry: what it does on a serial line and on a bus (made of a seed), to the world, to a truth."""

    name: str
    devices: tuple[str, ...]
    meaning: str
    make: Callable[[int], line.StreamFault] | None = None
    on_bus: Callable[[int], bus.BusFault] | None = None
    on_world: truth.WorldFault | None = None
    on_truth: truth.SensorFault | None = None


@dataclass(frozen=True, slots=True)
class FaultSpec:
    """One requested fault: kind, devices, start and end."""

    name: str
    devices: tuple[str, ...]
    start_s: float = DEFAULT_START_S
    duration_s: float = DEFAULT_DURATION_S


_KINDS = (
    FaultKind("absent", SERIAL + I2C + GPIO, "nothing is plugged in", line.Absent, bus.Absent),
    FaultKind(
        "wrong_identity", SERIAL + SENSORS_I2C + GPIO, "another device answers", line.WrongIdentity, bus.WrongIdentity
    ),
    FaultKind("nack", I2C + GPIO, "one transaction in ten is not acknowledged", on_bus=bus.Nack),
    FaultKind("bus_stuck", I2C, "a line of the bus is held low", on_bus=bus.BusStuck),
    FaultKind("short_read", I2C, "one read in ten ends early", on_bus=bus.ShortRead),
    FaultKind("cut_frames", SERIAL, "a piece is missing from every second message", line.CutFrames),
    FaultKind("bytewise", SERIAL, "every byte arrives separately", line.Bytewise),
    FaultKind("merged", SERIAL, "messages arrive a quarter of a second at a time", line.Merged),
    FaultKind("garbage", SERIAL, "bursts of random bytes among the messages", line.Garbage),
    FaultKind("bit_flips", SERIAL + I2C, "one bit in a thousand is wrong", line.BitFlips, bus.BitFlips),
    FaultKind("baud_mismatch", SERIAL, "both ends use different baud rates", line.BaudMismatch),
    FaultKind("unplug_replug", SERIAL, "the port vanishes and comes back", line.UnplugReplug),
    FaultKind("reset", SERIAL + I2C + GPIO, "the device restarts in mid-stream", line.Reset, bus.Reset),
    FaultKind("clock_jump", ("dvl75",), "the device's clock jumps ahead, and back at the end", line.ClockJump),
    FaultKind(
        "saturated", SERIAL + SENSORS_I2C, "measurements at the end of their scale", line.Saturated, bus.Saturated
    ),
    FaultKind("repeated", SERIAL + SENSORS_I2C, "the device repeats its last message", line.Repeated, bus.Repeated),
    FaultKind("velocity_bias", ("dvl75",), "0.25 m/s of bias forward", on_truth=truth.velocity_bias),
    FaultKind("velocity_frozen", ("dvl75",), "the velocity freezes", on_truth=truth.velocity_frozen),
    FaultKind("false_lock", ("dvl75",), "locked on something that moves with the vehicle", on_truth=truth.false_lock),
    FaultKind("gyro_offset", ("icm20948",), "40 deg/s of bias in the roll rate", on_truth=truth.gyro_offset),
    FaultKind("force_offset", ("icm20948",), "3 m/s^2 of bias to starboard", on_truth=truth.force_offset),
    FaultKind("depth_stuck", ("ms5837",), "the pressure freezes", on_truth=truth.depth_stuck),
    FaultKind("range_short", ("ping1d",), "an echo half a meter too near, as of a fish", on_truth=truth.range_short),
    FaultKind("thruster_fails", THRUSTERS, "a thruster gives no thrust", on_world=truth.thruster_fails),
    FaultKind("lock_lost", ("dvl75",), "the DVL finds no bottom", on_world=truth.lock_lost),
    FaultKind("leak", ("hull",), "water comes into the dry hull", on_world=truth.leak),
    FaultKind("current", ("water",), "0.15 m/s across the pool", on_world=truth.current),
)

FAULTS: Mapping[str, FaultKind] = {kind.name: kind for kind in _KINDS}


def parse_fault(text: str) -> FaultSpec:
    """Parse a fault specification. UsageError names the error and the known faults."""
    head, at, when = text.partition("@")
    name, colon, device = head.partition(":")
    kind = FAULTS.get(name)
    if kind is None:
        raise UsageError(f"--fault {text}: found {name!r}, wanted one of {', '.join(FAULTS)}; the form is {FORM}")
    if colon and device not in kind.devices:
        known = ", ".join(kind.devices)
        raise UsageError(f"--fault {text}: {name} on {device!r}, wanted one of {known}; the form is {FORM}")
    start, plus, duration = when.partition("+")
    return FaultSpec(
        name,
        (device,) if colon else kind.devices,
        _seconds(start, text) if at else DEFAULT_START_S,
        _seconds(duration, text) if plus else DEFAULT_DURATION_S,
    )


def _seconds(written: str, text: str) -> float:
    try:
        seconds = float(written)
    except ValueError:
        seconds = math.nan
    if not 0.0 <= seconds < math.inf:
        raise UsageError(f"--fault {text}: found {written!r}, wanted seconds from 0 up; the form is {FORM}")
    return seconds


def with_faults(
    name: str, device: SerialEmulator, specs: Sequence[FaultSpec], seed: int = 0, start_s: float = 0.0
) -> SerialEmulator:
    """Wrap the device `name` with the faults that apply to it; returns the device itself without faults.

    Times of the specifications count from `start_s` of the world's time.
    """
    schedule = _schedule(name, specs, start_s, lambda kind, at: kind.make and kind.make(seed * 1009 + at))
    return line.FaultyLine(device, schedule) if schedule else device


def with_bus_faults(
    name: str, device: Any, specs: Sequence[FaultSpec], seed: int = 0, start_s: float = 0.0
) -> Callable[[RegisterEmulator], RegisterEmulator]:
    """Return what wraps every address of the I2C part `name` with its faults. Times count from `start_s`."""
    schedule = _schedule(name, specs, start_s, lambda kind, at: kind.on_bus and kind.on_bus(seed * 1009 + at))
    return partial(bus.FaultyPort, device, FaultSchedule(schedule))


def fault_injector(world: World, specs: Sequence[FaultSpec], start_s: float = 0.0) -> Callable[[float], None]:
    """Return what starts and ends the faults of vehicle and water, by time. Times count from `start_s`."""
    acting = [(spec, FAULTS[spec.name].on_world) for spec in specs]
    schedule = FaultSchedule(
        [_scheduled((fault, one), spec, start_s) for spec, fault in acting if fault for one in spec.devices]
    )

    def inject(now_s: float) -> None:
        for (fault, target), on in schedule.advance(now_s):
            fault(world, target, on)

    return inject


def altered_truth(name: str, specs: Sequence[FaultSpec], start_s: float = 0.0) -> Callable[[Any, float], Any]:
    """Return the truth as the device `name` senses it, from the truth and the time. Times count from `start_s`."""
    schedule = FaultSchedule(_schedule(name, specs, start_s, lambda kind, _at: kind.on_truth))
    before: dict[truth.SensorFault, tuple[Any, float]] = {}

    def observed(true: Any, now_s: float) -> Any:
        for fault, _ in schedule.advance(now_s):
            before.pop(fault, None)
        for fault in schedule.active:
            was, was_s = before.get(fault, (true, now_s))
            true = fault(true, was, now_s - was_s)
            before[fault] = true, now_s
        return true

    return observed


def _schedule(
    name: str, specs: Sequence[FaultSpec], start_s: float, make: Callable[[FaultKind, int], FaultT | None]
) -> list[Scheduled[FaultT]]:
    """Those faults that fall on the device `name`; `make` gets the index of each in the list."""
    made = [(make(FAULTS[spec.name], at), spec) for at, spec in enumerate(specs) if name in spec.devices]
    return [_scheduled(fault, spec, start_s) for fault, spec in made if fault is not None]


def _scheduled(fault: FaultT, spec: FaultSpec, start_s: float) -> Scheduled[FaultT]:
    begin_s = start_s + spec.start_s
    return Scheduled(fault, begin_s, begin_s + spec.duration_s)
