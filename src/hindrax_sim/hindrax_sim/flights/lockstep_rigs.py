"""Rigs between the mock world and the stack in lock-step: sensors at reading level, or every byte.

A rig advances time to the next readings, and applies pulses to the thrusters. Both rigs answer with the same
readings in the same form, so they are interchangeable.
"""

import heapq
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any, TypeAlias

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output, Send, SerialDevice
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, Stamped, after, to_s
from hindrax_core.readings import AppliedPulses, Reading
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.driver_registry import driver_of
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec, as_built, fault_injector
from hindrax_sim.flights.lockstep_outputs import AutopilotOutput, ChipOutput, transfer
from hindrax_sim.flights.sensor_models import SensorModel, SensorNoise, sensors
from hindrax_sim.hardware import START, THRUSTERS, Hardware, STEP_ns
from hindrax_sim.world import Conditions, World

SensorReading: TypeAlias = tuple[str, Stamped[Reading]]
TICK_S = 0.1
SET_UP_S = 20.0
"""Longest time in which an autopilot answers for its parameters and streams."""


class ReadingsRig:
    """Sensors modelled as readings: truth, noise, rounding, rate and latency, without bytes.

    It applies the faults of the world only; it has no wires. UsageError for a fault that needs them.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        seed: int,
        conditions: Conditions | None = None,
        faults: Sequence[FaultSpec] = (),
        built: Vehicle | None = None,
    ) -> None:
        """`built`: the vehicle as it is, where its file does not say so."""
        for fault in faults:
            kind = FAULTS[fault.name]
            if kind.on_world is None and kind.on_vehicle is None:
                raise UsageError(f"fault {fault.name}: is one of wires, which readings do not have; fly by bytes")
        self.world = World(as_built(built or vehicle, faults), seed, conditions)
        channels = [one.channel for one in vehicle.thrusters]
        self._order = [channels.index(one.channel) for one in self.world.vehicle.thrusters]
        self.world.settle(START)
        self._inject = fault_injector(self.world, faults, to_s(START))
        self._queue: list[tuple[int, int, SensorModel, Sequence[Stamped[Reading]]]] = []
        self._count = 0
        for sensor in sensors(self.world, SensorNoise(), seed):
            self._push(START + sensor.period_ns, sensor, ())

    def _push(self, when: int, sensor: SensorModel, readings: Sequence[Stamped[Reading]]) -> None:
        self._count += 1
        heapq.heappush(self._queue, (when, self._count, sensor, readings))

    def advance(self) -> Sequence[SensorReading]:
        """Advance time to the next reading of a sensor."""
        world, queue = self.world, self._queue
        while True:
            when, _, sensor, readings = heapq.heappop(queue)
            world.advance(Stamp(when))
            if readings:
                self._inject(to_s(world.stamp))
                return [(sensor.source, one) for one in readings]
            readings = sensor.sample()
            self._push(when + sensor.period_ns, sensor, ())
            if readings:
                self._push(when + sensor.latency_ns, sensor, readings)

    def drive(self, pulses_us: Sequence[float], *, armed: bool) -> Stamped[AppliedPulses]:
        """Apply thruster pulses, unrounded: each to the motor at its channel."""
        del armed
        pulses = tuple(pulses_us)
        self.world.drive([pulses[index] for index in self._order])
        return Stamped(self.world.stamp, AppliedPulses(pulses))

    def fault(self) -> str:
        """Return no fault: motors have none."""
        return ""


class BytesRig:
    """Every byte: emulators on wires and a virtual bus, read by the real drivers."""

    def __init__(
        self,
        vehicle: Vehicle,
        seed: int,
        conditions: Conditions | None = None,
        faults: Sequence[FaultSpec] = (),
        built: Vehicle | None = None,
    ) -> None:
        """`built`: the vehicle as it is, where its file does not say so."""
        if vehicle.output.device not in ("pca9685", "ardusub"):
            wanted = "wanted pca9685 or ardusub"
            raise UsageError(f"output.device: found {vehicle.output.device}, in lock-step by bytes {wanted}")
        self.hardware = Hardware(vehicle, seed, conditions, faults, built)
        self.world = self.hardware.world
        self.log: list[tuple[str, Output]] = []
        """Outputs of the drivers that are no readings."""
        self._schedule = BusSchedule()
        self._serial: dict[str, SerialDevice] = {}
        self._answers: dict[str, bytes] = {}
        riders: dict[str, SerialDevice] = {}
        for name, mount in vehicle.sensors.items():
            row = driver_of(mount.device)
            device: Any = row.make(row.knobs(), mount, vehicle)
            if name in vehicle.on_output_line:
                riders[name] = device
            elif row.serial:
                self._serial[name] = device
                self._handle(name, device.start(START))
            else:
                self._schedule.add(name, device, START)
        self._tick = START
        self._output: ChipOutput | AutopilotOutput
        if vehicle.output.device == "pca9685":
            self._output = ChipOutput(vehicle, self.hardware, self.log)
            return
        self._output = autopilot = AutopilotOutput(vehicle, self.hardware, riders, self.log)
        while not autopilot.ready and to_s(self.hardware.stamp) < to_s(START) + SET_UP_S:
            self._step()
        if not autopilot.ready:
            raise DeviceError(autopilot.trouble)

    def advance(self) -> Sequence[SensorReading]:
        """Advance time until a driver has a reading, at most one control period."""
        readings: list[SensorReading] = []
        end = after(self.world.stamp, 0.02)
        while not readings and self.world.stamp < end:
            readings += self._step()
        return readings

    def _step(self) -> list[SensorReading]:
        hardware = self.hardware
        last = hardware.stamp
        due = min(Stamp(last + STEP_ns), max(self._schedule.next_due(last), Stamp(last + 1)))
        readings: list[SensorReading] = []
        for name, data in hardware.advance(due).items():
            if name == THRUSTERS:
                readings += self._output.arrived(data)
                continue
            arrived = self._answers.pop(name, b"") + data
            if arrived:
                readings += self._handle(name, self._serial[name].feed(arrived, due))
        if due >= self._tick:
            self._tick = after(due, TICK_S)
            for name, device in self._serial.items():
                readings += self._handle(name, device.tick(due))
            readings += self._output.tick()
        for name, outputs in self._schedule.step(due, partial(transfer, hardware, due)):
            readings += self._handle(name, outputs)
        return readings

    def _handle(self, name: str, outputs: Iterable[Output]) -> list[SensorReading]:
        """Handle driver outputs: readings to the stack, bytes to the device, the rest into the log."""
        readings: list[SensorReading] = []
        for output in outputs:
            if isinstance(output, Stamped):
                readings.append((name, output))
            elif isinstance(output, Send):
                now_s = to_s(self.hardware.stamp)
                answer = self.hardware.serial[name].receive(output.data, now_s)
                self._answers[name] = self._answers.get(name, b"") + answer
            else:
                self.log.append((name, output))
        return readings

    def drive(self, pulses_us: Sequence[float], *, armed: bool) -> Stamped[AppliedPulses]:
        """Write pulses through the driver of the output; return those that it makes of them."""
        return self._output.drive(pulses_us, armed=armed)

    def fault(self) -> str:
        """Why the output does not follow; empty where it does."""
        return self._output.fault()


LockstepRig: TypeAlias = ReadingsRig | BytesRig
