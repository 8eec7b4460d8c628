"""The registry of faults: names for `--fault`, which devices each applies to, and how it is written.

`garbage:dvl75@30+5` is the fault garbage on the device dvl75, from 30 s on, for 5 s. Without a device it falls on
every device it applies to; without a time it comes after 10 s; without a duration it lasts 5 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hindrax_core.devices import SENSORS
from hindrax_core.errors import UsageError
from hindrax_sim import bus_faults, stream_faults
from hindrax_sim.bus_faults import Afflicted, BusFault, ScheduledBusFault
from hindrax_sim.devices.serial_emulator import SerialEmulator
from hindrax_sim.stream_faults import FaultyLine, Scheduled, StreamFault
from hindrax_sim.world import World
from hindrax_sim.world_faults import Current, Fate, LockLost, ScheduledWorldFault, ThrusterFails, WorldFault

SERIAL = tuple(sensor.name for sensor in SENSORS if sensor.serial)
SENSORS_I2C = tuple(sensor.name for sensor in SENSORS if not sensor.serial)
I2C = (*SENSORS_I2C, "thrusters")
THRUSTERS = tuple(f"T{number}" for number in range(1, 9))
DEFAULT_START_S, DEFAULT_DURATION_S = 10.0, 5.0
FORM = "NAME[:DEVICE][@START[+SECONDS]], such as garbage:dvl75@30+5"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A row of the registry; `make` and `on_bus` take a seed.

    Stream faults go into a FaultyLine, bus faults into an Afflicted part.
    """

    name: str
    devices: tuple[str, ...]
    make: Callable[[int], StreamFault] | None
    meaning: str
    on_bus: Callable[[int], BusFault] | None = None
    on_world: Callable[[], WorldFault] | None = None


@dataclass(frozen=True, slots=True)
class FaultSpec:
    """One fault as asked for: which, on which devices, from when, until when."""

    name: str
    devices: tuple[str, ...]
    start_s: float = DEFAULT_START_S
    duration_s: float = DEFAULT_DURATION_S


_KINDS = (
    FaultKind("absent", SERIAL + I2C, stream_faults.Absent, "nothing is plugged in", bus_faults.Absent),
    FaultKind(
        "wrong_identity",
        SERIAL + SENSORS_I2C,
        stream_faults.WrongIdentity,
        "another device answers",
        bus_faults.WrongIdentity,
    ),
    FaultKind("nack", I2C, None, "one transaction in ten is not acknowledged", bus_faults.Nack),
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
    FaultKind("reset", SERIAL + I2C, stream_faults.Reset, "the device restarts in mid-stream", bus_faults.Reset),
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
    FaultKind("thruster_fails", THRUSTERS, None, "a thruster gives no thrust", on_world=ThrusterFails),
    FaultKind("lock_lost", ("dvl75",), None, "the DVL finds no bottom", on_world=LockLost),
    FaultKind("current", ("water",), None, "0.15 m/s across the pool", on_world=Current),
)

FAULTS: Mapping[str, FaultKind] = {kind.name: kind for kind in _KINDS}


def parse_fault(text: str) -> FaultSpec:
    """Read a fault specification. UsageError says what is wrong with it and what is known."""
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
    name: str, device: SerialEmulator[Any], specs: Sequence[FaultSpec], seed: int = 0, start_s: float = 0.0
) -> SerialEmulator[Any]:
    """Put the faults that fall on the device called `name` into its line; the device itself when there are none.

    Times of the specifications count from `start_s` of the world's time.
    """
    schedule = []
    for number, spec in enumerate(specs):
        make, begin_s = FAULTS[spec.name].make, start_s + spec.start_s
        if name in spec.devices and make is not None:
            schedule.append(Scheduled(make(seed * 1009 + number), begin_s, begin_s + spec.duration_s))
    return FaultyLine(device, schedule) if schedule else device


def with_bus_faults(
    name: str, device: Any, specs: Sequence[FaultSpec], seed: int = 0, start_s: float = 0.0
) -> Afflicted:
    """Make a part of the I2C bus suffer the faults that fall on the device called `name`.

    Attach `afflicted.at(port)` for every address that the part answers at. Times count from `start_s`.
    """
    schedule = []
    for number, spec in enumerate(specs):
        make, begin_s = FAULTS[spec.name].on_bus, start_s + spec.start_s
        if name in spec.devices and make is not None:
            schedule.append(ScheduledBusFault(make(seed * 1009 + number), begin_s, begin_s + spec.duration_s))
    return Afflicted(device, schedule)


def fate(world: World, specs: Sequence[FaultSpec], start_s: float = 0.0) -> Fate:
    """What will happen to vehicle and water. Times count from `start_s`."""
    schedule = []
    for spec in specs:
        make, begin_s = FAULTS[spec.name].on_world, start_s + spec.start_s
        if make is not None:
            schedule += [ScheduledWorldFault(make(), one, begin_s, begin_s + spec.duration_s) for one in spec.devices]
    return Fate(world, schedule)
