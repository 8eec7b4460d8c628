"""The whole vehicle in lock-step with the mock, without ROS: deterministic, and as fast as the computer is.

    session = Session(vehicle)
    step = Lockstep(vehicle, pilot, seed=7, session=session)
    for event in step.run(120.0): ...
    results = session.finalize().results

The same objects that run on the vehicle are stepped here in simulated time: devices (with `by_bytes`), navigator,
pilot with its holds and maneuvers, command guard, allocator, output guard, and with a session the identification.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from hindrax_control.allocation.allocation_cycle import AllocationCycle
from hindrax_control.navigation.estimator_health import EstimatorHealth
from hindrax_control.navigation.navigator import Navigator
from hindrax_core.events import Stamp, Stamped, after, seconds_between
from hindrax_core.readings import AppliedPulses, Battery, BottomVelocity, Echo, Pressure, Reading, Vec6
from hindrax_core.rotation import FSD
from hindrax_core.signals import ZERO6, Allocation, Estimate, Navigation, Phase, Supply, Thrust
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.output.output_guard import RefusedCommand, Request, guard_of
from hindrax_drivers.output.output_reasons import OutputReason, output_reason
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import Feed, Measurement, WallRange, wall_sonars
from hindrax_sim.faults.fault_registry import FaultSpec
from hindrax_sim.flights.lockstep_rigs import BytesRig, LockstepRig, ReadingsRig
from hindrax_sim.hardware import START
from hindrax_sim.world import Conditions, World

IDLE = Phase("", "")
Event: TypeAlias = Stamped[Navigation] | Stamped[Allocation] | Stamped[Phase] | Stamped[Estimate]


@dataclass(frozen=True, slots=True)
class LockstepCommand:
    """Command of a pilot: a wrench about the center of mass [N, N m], the phase of its motion, armed thrusters.

    `disabled` are thrusters to exclude permanently. `forces_N`: of the thrusters one by one, instead of the wrench.
    """

    wrench: Vec6 = ZERO6
    phase: Phase = IDLE
    armed: bool = False
    finished: bool = False
    disabled: frozenset[str] = frozenset()
    forces_N: tuple[float, ...] = ()


class LockstepPilot(Protocol):
    """Flies the vehicle: one command per Navigation."""

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Return the next command.

        Parameters
        ----------
        navigation
            State of the vehicle.
        became
            What the allocation has made of the last wrench; None before the first.
        armed
            Whether the output guard lets pulses through.

        Returns
        -------
        LockstepCommand
            Wrench or forces [N, N m], phase, and whether it should be armed.
        """


class LockstepOutput(Protocol):
    """What makes the pulses."""

    def drive(self, pulses_us: Sequence[float], *, armed: bool) -> Stamped[AppliedPulses]:
        """Apply pulses of the thrusters [us], neutral ones where it is not armed; return the actual ones."""

    def fault(self) -> str:
        """Why it does not follow; empty where it does."""


class Onboard:
    """The stack between readings and pulses, without the world."""

    def __init__(self, vehicle: Vehicle, pilot: LockstepPilot, session: Session | None, output: LockstepOutput) -> None:
        self.navigator = Navigator(vehicle)
        self._session = session
        self.order = LockstepCommand()
        self._pilot, self._output = pilot, output
        self.cycle = AllocationCycle(vehicle)
        self._guard = guard_of(vehicle)
        self._state = self._guard.start(Stamp(0))
        self._health = EstimatorHealth(vehicle)
        self.unhealthy: tuple[str, ...] = ()
        """Reason why the state is not plausible; empty when it is."""
        self.output_fault = ""
        """Why the output, armed, ceased to follow; empty when it never did."""
        self._feed = Feed(vehicle, session.tuning if session is not None else None)
        self._wall_sonars = wall_sonars(vehicle)
        self._became: Allocation | None = None
        self._phase = IDLE
        self._requests = 0

    @property
    def armed(self) -> bool:
        """Whether the output guard passes pulses."""
        return self._state.armed

    @property
    def reason(self) -> str:
        """Reason why the output is not armed."""
        return self._state.reason

    def on_reading(self, source: str, reading: Stamped[Reading], now: Stamp) -> list[Event]:
        """Process one reading: navigate, judge the state, ask the pilot, allocate, and let the identification learn.

        Parameters
        ----------
        source
            Name of the sensor in the vehicle file.
        reading
            With the time at which it was valid.
        now
            Time of the output.

        Returns
        -------
        list[Event]
            What came of it, in the order in which it came.
        """
        events: list[Event] = []
        if isinstance(reading.reading, BottomVelocity | Pressure):
            self._learn(Stamped(reading.stamp, reading.reading), events)
        if isinstance(reading.reading, Echo) and source in self._wall_sonars:
            seen = WallRange(reading.reading.range_m, source, reading.reading.confidence)
            self._learn(Stamped(reading.stamp, seen), events)
        if isinstance(reading.reading, Battery):
            self.cycle.supply.update(reading.reading.voltage_V, self.cycle.now)
        navigation = self.navigator.step(reading, source)
        if navigation is None:
            return events
        events.append(navigation)
        self._learn(navigation, events)
        active = self._state.phase in {"arming", "armed"}
        forces_N = self._became.forces_N if self._became else ()
        self.unhealthy = self._health.step(navigation.reading, navigation.stamp, forces_N, armed=active)
        order = self.order = self._pilot.step(navigation, self._became, armed=self.armed)
        if order.phase != self._phase:
            self._phase = order.phase
            events.append(Stamped(navigation.stamp, order.phase))
            self._learn(Stamped(navigation.stamp, order.phase), events)
        self._command(order, navigation.stamp, now, events)
        return events

    def tick(self, now: Stamp) -> None:
        """Advance the output's time: without commands it goes neutral, as on the vehicle."""
        if self._state.armed and (fault := self._output.fault()):
            self.output_fault = fault
            self._state = self._guard.drop(self._state, output_reason(OutputReason.DEVICE, found=fault), now)
        self._state, due = self._guard.tick(self._state, now)
        if due is not None:
            self._output.drive(due.thrusters, armed=self._state.armed)

    def flush(self) -> list[Event]:
        """Pass the samples that still wait for late ones to the identification."""
        events: list[Event] = []
        if self._session is not None:
            for event in self._feed.flush():
                events += self._session.step(event)
        return events

    def _command(self, order: LockstepCommand, stamp: Stamp, now: Stamp, events: list[Event]) -> None:
        """Wrench to pulses: allocation with its guard, output guard; then the wrench achieved by the applied pulses."""
        self._arm(order.armed and not self.unhealthy, now)
        if not order.disabled <= self.cycle.disabled:
            self.cycle.disable(self.cycle.disabled | order.disabled)
        moves = self.armed and not self.unhealthy
        wanted, forces_N = (order.wrench, order.forces_N) if moves else (ZERO6, ())
        planned = self.cycle.command(wanted, FSD, stamp, now, forces_N)
        if planned is None:
            return
        command = planned._replace(pulses_us=tuple(map(float, planned.pulses_us)), stamp=now)
        self._state, answer = self._guard.command(self._state, command, now)
        if isinstance(answer, RefusedCommand):
            return
        made = self._output.drive(answer.thrusters, armed=self.armed)
        applied = self.cycle.achieved(planned.sequence, made.reading.pulses_us)
        self._state = self._guard.written(self._state)
        self._became = applied
        self.navigator.thrust(applied.forces_N)
        events.append(Stamped(made.stamp, applied))
        supply = Supply.ASSUMED if self.cycle.supply_V is None else Supply.MEASURED
        thrust = Thrust(applied.achieved, applied.forces_N, supply)
        self._learn(Stamped(made.stamp, thrust), events)

    def _arm(self, wanted: bool, now: Stamp) -> None:
        """Request arming or disarming as the pilot wants; the guard decides."""
        arming = self._state.phase in {"arming", "armed"}
        if wanted == arming:
            return
        self._requests += 1
        ask = self._guard.arm if wanted else self._guard.disarm
        self._state, _ = ask(self._state, Request(now, self._requests), now)

    def _learn(self, measurement: Stamped[Measurement], events: list[Event]) -> None:
        if self._session is None:
            return
        for event in self._feed.step(measurement):
            events += self._session.step(event)


class Lockstep:
    """World, rig and stack, in step: by readings (fast), or by the bytes of every emulator and every driver."""

    def __init__(
        self,
        vehicle: Vehicle,
        pilot: LockstepPilot,
        seed: int = 0,
        *,
        by_bytes: bool = False,
        conditions: Conditions | None = None,
        faults: Sequence[FaultSpec] = (),
        session: Session | None = None,
        listen: Callable[[str, Stamped[Reading]], None] = lambda _source, _reading: None,
        built: Vehicle | None = None,
    ) -> None:
        """`listen` is called with every reading before the stack gets it.

        `session`: identifies the vehicle; without one nothing does, which saves a seventh of the time of a flight.
        `built`: the vehicle as it is, where its file does not say so.
        """
        self._listen = listen
        rig = BytesRig if by_bytes else ReadingsRig
        self.rig: LockstepRig = rig(vehicle, seed, conditions, faults, built)
        self.onboard = Onboard(vehicle, pilot, session, self.rig)
        self.world: World = self.rig.world
        """The truth."""
        self._start = START

    @property
    def elapsed_s(self) -> float:
        """Simulated time since the devices were switched on."""
        return seconds_between(self._start, self.world.stamp)

    def run(self, seconds: float) -> Iterator[Event]:
        """Run until the pilot has finished or the time is over; yields the events."""
        end = after(self.world.stamp, seconds)
        while self.world.stamp < end and not self.onboard.order.finished:
            readings = self.rig.advance()
            self.onboard.tick(self.world.stamp)
            for source, reading in readings:
                self._listen(source, reading)
                yield from self.onboard.on_reading(source, reading, self.world.stamp)
                if self.onboard.order.finished:
                    break
        yield from self.onboard.flush()
