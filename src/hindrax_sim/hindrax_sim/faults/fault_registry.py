"""Registry of faults: names for `--fault`, the devices of each, and the syntax.

`garbage:dvl75@30+5` is the fault garbage on the device dvl75, from 30 s on, for 5 s. Without a device it falls on
every device it applies to; without a time it comes after 10 s; without a duration it lasts 5 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from hindrax_core.errors import UsageError
from hindrax_core.sensor_table import SENSORS
from hindrax_sim.devices.serial_emulator import SerialEmulator
from hindrax_sim.faults import bus_faults, device_lies, stream_faults, world_faults
from hindrax_sim.faults.bus_faults import BusFault, FaultyBus
from hindrax_sim.faults.device_lies import SensorFault, SensorFaultInjector
from hindrax_sim.faults.fault_schedule import Scheduled
from hindrax_sim.faults.stream_faults import FaultyLine, StreamFault
from hindrax_sim.faults.world_faults import FaultInjector, WorldFault
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
    """A row of the registry; `make` and `on_bus` take a seed.

    Stream faults apply to a FaultyLine, bus faults to a FaultyBus, lies to what a device measures.
    """

    name: str
    devices: tuple[str, ...]
    make: Callable[[int], StreamFault] | None
    meaning: str
    on_bus: Callable[[int], BusFault] | None = None
    on_world: WorldFault | None = None
    on_truth: Callable[[], SensorFault] | None = None


@dataclass(frozen=True, slots=True)
class FaultSpec:
    """One requested fault: kind, devices, start and end."""

    name: str
    devices: tuple[str, ...]
    start_s: float = DEFAULT_START_S
    duration_s: float = DEFAULT_DURATION_S


_KINDS = (
    FaultKind("absent", SERIAL + I2C + GPIO, stream_faults.Absent, "nothing is plugged in", bus_faults.Absent),
    FaultKind(
        "wrong_identity",
        SERIAL + SENSORS_I2C + GPIO,
        stream_faults.WrongIdentity,
        "another device answers",
        bus_faults.WrongIdentity,
    ),
    FaultKind("nack", I2C + GPIO, None, "one transaction in ten is not acknowledged", bus_faults.Nack),
    FaultKind("bus_stuck", I2C, None, "a line of the bus is held low", bus_faults.BusStuck),
    FaultKind("short_read", I2C, None, "one read in ten ends early", bus_faults.ShortRead),
    FaultKind("cut_frames", SERIAL, stream_faults.CutFrames, "a piece is missing from every second message"),
    FaultKind("bytewise", SERIAL, stream_faults.Bytewise, "every byte arrives by itself"),
    FaultKind("merged", SERIAL, stream_faults.Merged, "messages arrive a quarter of a second at a time"),
    FaultKind("garbage", SERIAL, stream_faults.Garbage, "bursts of random bytes among the messages"),
    FaultKind(
        "bit_flips",
        SERIAL + I2C,
        stream_faults.BitFlips,
        "one bit in a thousand is wrong",
        bus_faults.BitFlips,
    ),
    FaultKind("baud_mismatch", SERIAL, stream_faults.BaudMismatch, "both ends speak at different speeds"),
    FaultKind("unplug_replug", SERIAL, stream_faults.UnplugReplug, "the port vanishes and comes back"),
    FaultKind("reset", SERIAL + I2C + GPIO, stream_faults.Reset, "the device restarts in mid-stream", bus_faults.Reset),
    FaultKind("clock_jump", ("dvl75",), stream_faults.ClockJump, "the device's clock leaps ahead, and back at the end"),
    FaultKind(
        "saturated",
        SERIAL + SENSORS_I2C,
        stream_faults.Saturated,
        "measurements at the end of their scale",
        bus_faults.Saturated,
    ),
    FaultKind(
        "repeated",
        SERIAL + SENSORS_I2C,
        stream_faults.Repeated,
        "the device says its last words again and again",
        bus_faults.Repeated,
    ),
    FaultKind("velocity_bias", ("dvl75",), None, "0.25 m/s forward too much", on_truth=device_lies.VelocityBias),
    FaultKind(
        "velocity_frozen", ("dvl75",), None, "the velocity stays as it is", on_truth=lambda: device_lies.velocity_frozen
    ),
    FaultKind(
        "false_lock", ("dvl75",), None, "locked on what moves along with the vehicle", on_truth=device_lies.FalseLock
    ),
    FaultKind(
        "gyro_offset", ("icm20948",), None, "40 deg/s of roll too much", on_truth=lambda: device_lies.gyro_offset
    ),
    FaultKind(
        "force_offset", ("icm20948",), None, "3 m/s^2 to starboard too much", on_truth=lambda: device_lies.force_offset
    ),
    FaultKind("depth_stuck", ("ms5837",), None, "the pressure stays as it is", on_truth=device_lies.DepthStuck),
    FaultKind(
        "range_short",
        ("ping1d",),
        None,
        "an echo half a meter too near, as of a fish",
        on_truth=lambda: device_lies.range_short,
    ),
    FaultKind("thruster_fails", THRUSTERS, None, "a thruster gives no thrust", on_world=world_faults.thruster_fails),
    FaultKind("lock_lost", ("dvl75",), None, "the DVL finds no bottom", on_world=world_faults.lock_lost),
    FaultKind("leak", ("hull",), None, "water comes into the dry hull", on_world=world_faults.leak),
    FaultKind("current", ("water",), None, "0.15 m/s across the pool", on_world=world_faults.current),
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
    schedule = _schedule(name, specs, start_s, lambda kind, at: kind.make(seed * 1009 + at) if kind.make else None)
    return FaultyLine(device, schedule) if schedule else device


def with_bus_faults(
    name: str, device: Any, specs: Sequence[FaultSpec], seed: int = 0, start_s: float = 0.0
) -> FaultyBus:
    """Wrap an I2C part with the faults that apply to the device `name`.

    Attach `made.at(port)` for every address of the part. Times count from `start_s`.
    """
    schedule = _schedule(name, specs, start_s, lambda kind, at: kind.on_bus(seed * 1009 + at) if kind.on_bus else None)
    return FaultyBus(device, schedule)


def fault_injector(world: World, specs: Sequence[FaultSpec], start_s: float = 0.0) -> FaultInjector:
    """Injector of the faults of vehicle and water. Times count from `start_s`."""
    schedule = [
        _scheduled((fault, target), spec, start_s)
        for spec in specs
        if (fault := FAULTS[spec.name].on_world) is not None
        for target in spec.devices
    ]
    return FaultInjector(world, schedule)


def liar(name: str, specs: Sequence[FaultSpec], start_s: float = 0.0) -> SensorFaultInjector:
    """What the device `name` takes for the truth. Times of the specifications count from `start_s`."""
    return SensorFaultInjector(
        _schedule(name, specs, start_s, lambda kind, _at: kind.on_truth() if kind.on_truth else None)
    )


def _schedule(
    name: str, specs: Sequence[FaultSpec], start_s: float, make: Callable[[FaultKind, int], FaultT | None]
) -> list[Scheduled[FaultT]]:
    """Those faults that fall on the device `name`; `make` is told the place of each in the list."""
    made = [(make(FAULTS[spec.name], at), spec) for at, spec in enumerate(specs) if name in spec.devices]
    return [_scheduled(fault, spec, start_s) for fault, spec in made if fault is not None]


def _scheduled(fault: FaultT, spec: FaultSpec, start_s: float) -> Scheduled[FaultT]:
    begin_s = start_s + spec.start_s
    return Scheduled(fault, begin_s, begin_s + spec.duration_s)
