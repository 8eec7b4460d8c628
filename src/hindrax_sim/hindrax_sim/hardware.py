"""The mock vehicle's hardware: the world, and every device of the vehicle file in it. No ports, no clock."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, Self

from hindrax_core.bus_operations import EDGES
from hindrax_core.errors import UsageError, cause
from hindrax_core.events import Stamp, stamp_from_s, to_s
from hindrax_core.readings import Battery, Vec3
from hindrax_core.sensor_table import row_of
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.ardupilot.firmware import ArduSub, AutopilotTruth, autopilot_truth
from hindrax_sim.devices.ardusub_ekf import aided
from hindrax_sim.devices.ardusub_range import ping_truth, ranged
from hindrax_sim.devices.dvl75 import dvl_truth
from hindrax_sim.devices.emulator import Emulator, SerialEmulator
from hindrax_sim.devices.pca9685 import LoopBack, Pca9685
from hindrax_sim.devices.stm32 import Stm32
from hindrax_sim.faults import fault_registry
from hindrax_sim.physics.plant import Plant
from hindrax_sim.world import Conditions, Mounting, World

START = stamp_from_s(10.0)
STEP_S = 0.005
STEP_ns = stamp_from_s(STEP_S)
ALL_CALL, GENERAL_CALL = 0x70, 0x00
LOOP_CHANNEL, LOOP_LINE = 15, 17
"""Spare channel of the PCA9685, and the GPIO that it is wired back to, as `hindrax oscillator` has it by default."""
THRUSTERS = "thrusters"
NEUTRAL_us, TOLERANCE_us = 1500.0, 2.0


@cache
def emulator_of(device: str) -> Emulator:
    """Emulator of a kind of sensor. UsageError where there is none: a package of another may bring only a driver."""
    try:
        row = row_of(device)
        found: Emulator = import_module(row.emulator_module).EMULATOR
    except ValueError as error:
        raise UsageError(f"device: {error}") from error
    except (ImportError, AttributeError) as error:
        raise UsageError(f"{device}: {row.emulator_module} offers no EMULATOR ({cause(error)})") from error
    return found


@dataclass(frozen=True, slots=True)
class TrueState:
    """Truth at one instant of a mock flight; also a line of a log.

    Velocity is that over ground, in body axes. A pulse of zero is none at all. Place: along and across the pool.
    """

    now_s: float
    attitude_rad: Vec3
    velocity_mps: Vec3
    depth_m: float
    wall_hits: int
    place_m: tuple[float, float]
    pulses_us: tuple[float, ...]

    @classmethod
    def parse(cls, line: str) -> Self:
        """Undo `line`."""
        now_s, roll, pitch, yaw, u, v, w, depth_m, hits, x_m, y_m, *pulses = map(float, line.split())
        return cls(now_s, (roll, pitch, yaw), (u, v, w), depth_m, int(hits), (x_m, y_m), tuple(pulses))

    def line(self) -> str:
        """All numbers in their order."""
        numbers = (*self.attitude_rad, *self.velocity_mps, self.depth_m, self.wall_hits, *self.place_m, *self.pulses_us)
        return f"{self.now_s:.4f} {' '.join(f'{number:.4f}' for number in numbers)}\n"

    @property
    def neutral(self) -> bool:
        """Whether no thruster is commanded to turn."""
        return all(abs(pulse - NEUTRAL_us) < TOLERANCE_us or pulse == 0.0 for pulse in self.pulses_us)

    @property
    def tilt_deg(self) -> float:
        """Angle between the vehicle's vertical and the world's."""
        roll, pitch, _ = self.attitude_rad
        return math.degrees(math.acos(max(-1.0, min(1.0, math.cos(roll) * math.cos(pitch)))))


class Hardware:
    """World and devices in step: output pulses drive the plant, devices get the truth at their mounts."""

    def __init__(
        self,
        vehicle: Vehicle,
        seed: int,
        conditions: Conditions | None = None,
        faults: Sequence[fault_registry.FaultSpec] = (),
        built: Vehicle | None = None,
        *,
        plant: type[Plant] = Plant,
    ) -> None:
        """`built`: the vehicle as it is, where its file does not say so. `plant`: what moves it."""
        self.vehicle = vehicle
        self.world = World(fault_registry.as_built(built or vehicle, faults), seed, conditions, plant)
        self.i2c = VirtualI2c()
        self.serial: dict[str, SerialEmulator] = {}
        self.registers: dict[str, object] = {}
        self.output: Pca9685 | Stm32 | ArduSub
        self._channels = tuple(thruster.channel for thruster in vehicle.thrusters)
        self._truth_setters: list[Callable[[float], None]] = []
        self._faults, self._inject = faults, fault_registry.fault_injector(self.world, faults, to_s(START))
        self._attach_output(seed)
        for number, (name, mount) in enumerate(vehicle.sensors.items()):
            if name in vehicle.on_output_line:
                continue
            self._attach(name, mount, seed * 101 + number)
        self.world.settle(START)
        self._set_truths()

    @property
    def stamp(self) -> Stamp:
        """Time of the world."""
        return self.world.stamp

    @property
    def turns(self) -> bool:
        """Whether a thruster turns."""
        return any(self.world.plant.targets_N)

    def advance(self, stamp: Stamp) -> dict[str, bytes]:
        """Advance time; return the bytes of each serial device."""
        pulses = self.output.pulses_us()
        self._inject(to_s(stamp))
        self.world.drive([pulses[one.channel] or 0.0 for one in self.world.vehicle.thrusters])
        self.world.advance(stamp)
        now_s = self._set_truths()
        return {name: device.step(now_s) for name, device in self.serial.items()}

    def true_state(self) -> TrueState:
        """Pose, velocity and pulses of now."""
        world, pulses, pool = self.world, self.output.pulses_us(), self.vehicle.pool
        return TrueState(
            to_s(world.stamp),
            world.attitude_rad,
            world.plant.velocity_over_ground,
            world.depth_m,
            world.box.wall_hits,
            (world.plant.x + 0.5 * pool.length_m, world.plant.y + 0.5 * pool.width_m),
            tuple(pulses[channel] or 0.0 for channel in self._channels),
        )

    def _set_truths(self) -> float:
        now_s = to_s(self.world.stamp)
        for set_truth in self._truth_setters:
            set_truth(now_s)
        return now_s

    def _attach_output(self, seed: int) -> None:
        output = self.vehicle.output
        if output.device == "ros2_control":
            raise UsageError(
                f"{self.vehicle.name}: found output.device ros2_control, wanted one that the mock emulates (pca9685, "
                "stm32, ardusub): fly it on the simulator that has its controllers (docs/how-to/ros2-control.md)"
            )
        if output.on_line:
            board = self.output = self._board(seed)
            on_line = [spec for spec in self._faults if fault_registry.FAULTS[spec.name].make is not None]
            self.serial[THRUSTERS] = fault_registry.with_faults(THRUSTERS, board, on_line, seed, to_s(START))
            return
        chip = self.output = Pca9685()
        afflicted = fault_registry.with_bus_faults(THRUSTERS, chip, self._faults, seed, to_s(START))
        self.i2c.attach(output.address, afflicted(chip))
        self.i2c.attach(ALL_CALL, chip.all_call)
        self.i2c.attach(GENERAL_CALL, chip.general_call)
        taken = {one.data_ready.rpartition(":")[2] for one in self.vehicle.sensors.values()}
        if str(LOOP_LINE) not in taken:
            self.i2c.attach(EDGES + LOOP_LINE, LoopBack(chip, LOOP_CHANNEL))

    def _board(self, seed: int) -> Stm32 | ArduSub:
        """What makes the pulses at the far end of a line."""
        if self.vehicle.output.device == "ardusub":
            autopilot = ArduSub(self.vehicle.thrusters, seed, to_s(START))
            known = self._known_to_autopilot()
            self._truth_setters.append(lambda now_s: autopilot.set_truth(known(now_s), now_s))
            return autopilot
        board = Stm32(len(self._channels), len(self.vehicle.output.light_channels), to_s(START))
        board.set_truth(Battery(self.vehicle.supply_V), to_s(START))
        return board

    def _known_to_autopilot(self) -> Callable[[float], AutopilotTruth]:
        """What is true at an autopilot, by the sensors on its line."""
        named = {self.vehicle.sensors[name].device: name for name in self.vehicle.on_output_line}

        def at(device: str) -> tuple[Mounting, Any]:
            name = named.get(device, "")
            mount = self.world.vehicle.sensors.get(name, Mount(device))
            return self.world.mounting(mount), fault_registry.altered_truth(name, self._faults, to_s(START))

        (place, observed), (aid_place, observed_aid) = at("ardusub"), at("ardusub_ekf")
        beam_place, observed_echo = at("ardusub_range")

        def known(now_s: float) -> AutopilotTruth:
            truth: AutopilotTruth = observed(autopilot_truth(self.world, place), now_s)
            if "ardusub_range" in named:
                truth = ranged(truth, observed_echo(ping_truth(self.world, beam_place), now_s))
            if "ardusub_ekf" in named:
                truth = aided(truth, observed_aid(dvl_truth(self.world, aid_place), now_s))
            return truth

        return known

    def _attach(self, name: str, mount: Mount, seed: int) -> None:
        row = emulator_of(mount.device)
        device = row.make(seed)
        at = self.world.mounting(self.world.vehicle.sensors[name])  # as it is mounted, whatever the file says
        observed = fault_registry.altered_truth(name, self._faults, to_s(START))
        self._truth_setters.append(lambda now_s: device.set_truth(observed(row.truth(self.world, at), now_s), now_s))
        if row_of(mount.device).serial:
            self.serial[name] = fault_registry.with_faults(name, device, self._faults, seed, to_s(START))
            return
        self.registers[name] = device
        afflicted = fault_registry.with_bus_faults(name, device, self._faults, seed, to_s(START))
        self.i2c.attach(row.address if mount.address is None else mount.address, afflicted(device))
        for address, part in row.also_at(device, mount).items():
            self.i2c.attach(address, part if address >= EDGES else afflicted(part))
