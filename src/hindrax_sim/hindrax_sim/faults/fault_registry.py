"""Registry of faults: names for `--fault`, the devices of each, and the syntax.

`garbage:dvl75@30+5` is the fault garbage on the sensor called dvl75 in the vehicle file, from 30 s on, for 5 s. Without
a device it falls on every one it applies to; without a time it comes after 10 s; without a duration it lasts 5 s.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import TypeVar

from hindrax_core.errors import UsageError
from hindrax_core.sensor_table import SENSORS, Capability, Sensor, Wire, row_of
from hindrax_core.text.nearest import did_you_mean, found_in
from hindrax_core.vehicle import Vehicle
from hindrax_sim.devices.emulator import RegisterEmulator, SerialEmulator
from hindrax_sim.faults import build_faults as build
from hindrax_sim.faults import bus_faults as bus
from hindrax_sim.faults import stream_faults as line
from hindrax_sim.faults import truth_faults as truth
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled
from hindrax_sim.world import World

FaultT = TypeVar("FaultT")
SERIAL: tuple[Wire, ...] = ("serial",)
I2C: tuple[Wire, ...] = ("i2c",)
GPIO: tuple[Wire, ...] = ("gpio",)
OUTPUT = ("thrusters",)
LINK = "link of an autopilot"
EACH_THRUSTER, EACH_PAIR = "thruster", "pair of thrusters"
DIRECTED: tuple[Capability, ...] = ("rates", "velocity", "range")
"""What is measured along an axis: how such a sensor is mounted matters."""
DEFAULT_START_S, DEFAULT_DURATION_S = 10.0, 5.0
FORM = "NAME[:DEVICE][@START[+SECONDS]], such as garbage:dvl75@30+5"


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A row of the registry: what it does on a serial line and on a bus (made of a seed), to the world, to a truth.

    It falls on the sensors of some wires, on those that measure something, and on `others`: the output, a thruster of
    the vehicle, a pair of them (T1-T2), hull or water. `on_vehicle`: how the vehicle is built, without begin and end.
    """

    name: str
    meaning: str
    make: Callable[[int], line.StreamFault] | None = None
    on_bus: Callable[[int], bus.BusFault] | None = None
    on_world: truth.WorldFault | None = None
    on_truth: truth.SensorFault | None = None
    on_vehicle: build.BuildFault | None = None
    wires: tuple[Wire, ...] = ()
    measuring: Capability | None = None
    also_measuring: tuple[Capability, ...] = ()
    others: tuple[str, ...] = ()

    def falls_on(self, row: Sensor) -> bool:
        """Whether it falls on sensors of a kind."""
        wanted = (self.measuring, *self.also_measuring)
        return row.wire in self.wires or any(one in row.measures for one in wanted)

    def devices(self, vehicle: Vehicle | None = None) -> tuple[str, ...]:
        """Names of what it falls on aboard a vehicle; without one, of every kind of sensor of this stack."""
        rows = {row.name: row for row in SENSORS}
        thrusters = [f"T{number}" for number in range(1, 9)]
        if vehicle is not None:
            rows = {name: row_of(mount.device) for name, mount in vehicle.sensors.items()}
            thrusters = [one.name for one in vehicle.thrusters]
            # What is on the line of the output suffers what that line suffers.
            rows = {name: row for name, row in rows.items() if self.on_truth or name not in vehicle.on_output_line}
        pairs = ["-".join(pair) for pair in combinations(thrusters, 2)]
        linked = vehicle is None or vehicle.output.device == "ardusub"
        named = {EACH_THRUSTER: thrusters, EACH_PAIR: pairs, LINK: list(OUTPUT) if linked else []}
        others = [name for one in self.others for name in named.get(one, [one])]
        return (*(name for name, row in rows.items() if self.falls_on(row)), *others)


@dataclass(frozen=True, slots=True)
class FaultSpec:
    """One requested fault: kind, devices, start and end."""

    name: str
    devices: tuple[str, ...]
    start_s: float = DEFAULT_START_S
    duration_s: float = DEFAULT_DURATION_S


KINDS = (
    FaultKind("absent", "nothing is plugged in", line.Absent, bus.Absent, wires=SERIAL + I2C + GPIO, others=OUTPUT),
    FaultKind(
        "wrong_identity", "another device answers", line.WrongIdentity, bus.WrongIdentity, wires=SERIAL + I2C + GPIO
    ),
    FaultKind("nack", "one transaction in ten is not acknowledged", on_bus=bus.Nack, wires=I2C + GPIO, others=OUTPUT),
    FaultKind("bus_stuck", "a line of the bus is held low", on_bus=bus.BusStuck, wires=I2C, others=OUTPUT),
    FaultKind("short_read", "one read in ten ends early", on_bus=bus.ShortRead, wires=I2C, others=OUTPUT),
    FaultKind("cut_frames", "a piece is missing from every second message", line.CutFrames, wires=SERIAL),
    FaultKind("bytewise", "every byte arrives separately", line.Bytewise, wires=SERIAL),
    FaultKind("merged", "messages arrive a quarter of a second at a time", line.Merged, wires=SERIAL),
    FaultKind("garbage", "bursts of random bytes among the messages", line.Garbage, wires=SERIAL),
    FaultKind(
        "bit_flips", "one bit in a thousand is wrong", line.BitFlips, bus.BitFlips, wires=SERIAL + I2C, others=OUTPUT
    ),
    FaultKind("baud_mismatch", "both ends use different baud rates", line.BaudMismatch, wires=SERIAL),
    FaultKind("unplug_replug", "the port vanishes and comes back", line.UnplugReplug, wires=SERIAL),
    FaultKind(
        "reset", "the device restarts in mid-stream", line.Reset, bus.Reset, wires=SERIAL + I2C + GPIO, others=OUTPUT
    ),
    FaultKind(
        "clock_jump", "the device's clock jumps ahead, and back at the end", line.ClockJump, measuring="velocity"
    ),
    FaultKind("saturated", "measurements at the end of their scale", line.Saturated, bus.Saturated, wires=SERIAL + I2C),
    FaultKind("repeated", "the device repeats its last message", line.Repeated, bus.Repeated, wires=SERIAL + I2C),
    FaultKind("link_loss", "one packet in five is lost, either way", line.LostFrames, others=(LINK,)),
    FaultKind("link_delay", "messages of the autopilot come 0.3 s late", line.LateFrames, others=(LINK,)),
    FaultKind("second_station", "another ground station moves its stick", line.SecondStation, others=(LINK,)),
    FaultKind("velocity_bias", "0.25 m/s of bias forward", on_truth=truth.velocity_bias, measuring="velocity"),
    FaultKind("velocity_frozen", "the velocity freezes", on_truth=truth.velocity_frozen, measuring="velocity"),
    FaultKind(
        "velocity_stuck", "the velocity stays, with its noise", on_truth=truth.velocity_stuck, measuring="velocity"
    ),
    FaultKind(
        "false_lock",
        "locked on something that moves with the vehicle",
        on_truth=truth.false_lock,
        measuring="velocity",
    ),
    FaultKind("gyro_offset", "40 deg/s of bias in the roll rate", on_truth=truth.gyro_offset, measuring="rates"),
    FaultKind("force_offset", "3 m/s^2 of bias to starboard", on_truth=truth.force_offset, measuring="rates"),
    FaultKind("gyro_scaled", "rates half as large again", on_truth=truth.gyro_scaled, measuring="rates"),
    FaultKind("gyro_turned", "rates turned by a quarter", on_truth=truth.gyro_turned, measuring="rates"),
    FaultKind("gyro_frozen", "the rates freeze", on_truth=truth.gyro_frozen, measuring="rates"),
    FaultKind("depth_stuck", "the pressure freezes", on_truth=truth.depth_stuck, measuring="depth"),
    FaultKind("depth_scaled", "a depth a fifth larger", on_truth=truth.depth_scaled, measuring="depth"),
    FaultKind("depth_drifts", "1 cm/s of drift of every depth", on_world=truth.depth_drifts, measuring="depth"),
    FaultKind("range_scaled", "ranges half as large again", on_truth=truth.range_scaled, measuring="range"),
    FaultKind("range_frozen", "the range freezes", on_truth=truth.range_frozen, measuring="range"),
    FaultKind(
        "range_short", "an echo half a meter too near, as of a fish", on_truth=truth.range_short, measuring="range"
    ),
    FaultKind("thruster_fails", "a thruster gives no thrust", on_world=truth.thruster_fails, others=(EACH_THRUSTER,)),
    FaultKind("velocity_turned", "turned by a quarter", on_truth=truth.velocity_turned, measuring="velocity"),
    FaultKind("velocity_scaled", "half as large again", on_truth=truth.velocity_scaled, measuring="velocity"),
    FaultKind("supply_dies", "no thruster has power", on_world=truth.supply_dies, others=("supply",)),
    FaultKind(
        "thruster_reverses",
        "a thruster begins to push the other way",
        on_world=truth.thruster_reversed,
        others=(EACH_THRUSTER,),
    ),
    FaultKind("lock_lost", "no DVL finds the bottom", on_world=truth.lock_lost, measuring="velocity"),
    FaultKind("leak", "water comes into the dry hull", on_world=truth.leak, others=("hull",)),
    FaultKind("current", "0.15 m/s across the pool", on_world=truth.current, others=("water",)),
    FaultKind(
        "thruster_reversed", "it pushes the other way", on_vehicle=build.thruster_reversed, others=(EACH_THRUSTER,)
    ),
    FaultKind(
        "thrusters_swapped", "they have each other's cable", on_vehicle=build.thrusters_swapped, others=(EACH_PAIR,)
    ),
    FaultKind(
        "dead_bands_wider", "20 us wider than the file says", on_vehicle=build.dead_bands_wider, others=("curves",)
    ),
    FaultKind("supply_sags", "150 milliohm more than the file says", on_vehicle=build.supply_sags, others=("supply",)),
    *(
        FaultKind(
            f"turned_{axis}_{angle}",
            f"mounted with a {axis} of {angle} deg that the file does not know",
            on_vehicle=build.turned((angle * (axis == "roll"), angle * (axis == "pitch"), angle * (axis == "yaw"))),
            also_measuring=DIRECTED,
        )
        for axis in ("roll", "pitch", "yaw")
        for angle in (90, 180)
    ),
)

FAULTS: Mapping[str, FaultKind] = {kind.name: kind for kind in KINDS}


def parse_fault(text: str, vehicle: Vehicle | None = None) -> FaultSpec:
    """Parse a fault specification, as `--fault` has it.

    Parameters
    ----------
    text
        NAME[:DEVICE][@START][+SECONDS].
    vehicle
        Whose devices it may fall on; None: one with each kind of sensor under the name of its kind.

    Returns
    -------
    FaultSpec
        Without a device: of all that it can fall on.

    Raises
    ------
    UsageError
        Names the error and the known faults, or what a fault can fall on.
    """
    head, at, when = text.partition("@")
    name, colon, device = head.partition(":")
    kind = FAULTS.get(name)
    if kind is None:
        turned = f"found {name!r} (did you mean {device}:{name}?)" if device in FAULTS else ""
        raise UsageError(f"--fault {text}: {turned or found_in(name, FAULTS)}; the form is {FORM}")
    devices = kind.devices(vehicle)
    if not devices:
        raise UsageError(f"--fault {text}: {name} falls on nothing aboard; see `sensors` in the vehicle file")
    if colon and device not in devices:
        wanted = f"{did_you_mean(device, devices)}, wanted one of {', '.join(devices)}"
        raise UsageError(f"--fault {text}: {name} on {device!r}{wanted}; the form is {FORM}")
    start, plus, duration = when.partition("+")
    return FaultSpec(
        name,
        (device,) if colon else devices,
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
    """Wrap a device on a serial line with the faults that apply to it.

    Parameters
    ----------
    name, device
        Name in the vehicle file, and its emulator.
    specs
        Of all faults.
    seed
        Of what is random in them.
    start_s : [s]
        Time of the world from which those of the specifications count.

    Returns
    -------
    SerialEmulator
        The device itself where none applies to it.
    """
    schedule = _schedule(name, specs, start_s, lambda kind, at: kind.make and kind.make(seed * 1009 + at))
    return line.FaultyLine(device, schedule) if schedule else device


def with_bus_faults(
    name: str, device: object, specs: Sequence[FaultSpec], seed: int = 0, start_s: float = 0.0
) -> Callable[[RegisterEmulator], RegisterEmulator]:
    """Return what wraps every address of an I2C part with its faults.

    Parameters
    ----------
    name, device
        Name in the vehicle file, and its emulator.
    specs, seed, start_s
        As of `with_faults`.

    Returns
    -------
    Callable[[RegisterEmulator], RegisterEmulator]
        From the emulator of one address to that with faults, or to itself where none applies; all addresses share
        their schedule.
    """
    schedule = _schedule(name, specs, start_s, lambda kind, at: kind.on_bus and kind.on_bus(seed * 1009 + at))
    return partial(bus.FaultyPort, device, FaultSchedule(schedule)) if schedule else lambda port: port


def fault_injector(world: World, specs: Sequence[FaultSpec], start_s: float = 0.0) -> Callable[[float], None]:
    """Return what starts and ends the faults of vehicle and water.

    Parameters
    ----------
    world
        Changed by them.
    specs, start_s
        As of `with_faults`.

    Returns
    -------
    Callable[[float], None]
        To be called with the time of the world [s] as it passes.
    """
    acting = [(spec, FAULTS[spec.name].on_world) for spec in specs]
    schedule = FaultSchedule(
        [_scheduled((fault, one), spec, start_s) for spec, fault in acting if fault for one in spec.devices]
    )

    def inject(now_s: float) -> None:
        for (fault, target), on in schedule.advance(now_s):
            fault(world, target, on)

    return inject


def as_built(vehicle: Vehicle, specs: Sequence[FaultSpec]) -> Vehicle:
    """Return the vehicle as it is wired and mounted with these faults; its own file does not know them."""
    for spec in specs:
        change = FAULTS[spec.name].on_vehicle
        for one in spec.devices if change else ():
            vehicle = change(vehicle, one) if change else vehicle
    return vehicle


def altered_truth(name: str, specs: Sequence[FaultSpec], start_s: float = 0.0) -> Callable[[object, float], object]:
    """Return what makes of the truth that which a device senses.

    Parameters
    ----------
    name
        In the vehicle file.
    specs, start_s
        As of `with_faults`.

    Returns
    -------
    Callable[[object, float], object]
        From truth and time of the world [s] to the truth of the same kind with the faults of that time.
    """
    falling = _schedule(name, specs, start_s, lambda kind, _at: kind.on_truth)
    if not falling:
        return lambda true, _now_s: true
    schedule = FaultSchedule(falling)
    before: dict[truth.SensorFault, tuple[object, float]] = {}

    def observed(true: object, now_s: float) -> object:
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
