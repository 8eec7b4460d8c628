"""Faults of devices, in lock-step and by bytes: every emulator, every driver, the whole stack without its processes."""

import random
from collections.abc import Iterator
from dataclasses import dataclass

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.hold.holds import Setpoint
from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.pilot import Pilot
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.signals import Allocation, Navigation
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.lockstep_rigs import BytesRig
from hindrax_tools.faults.fault_outcome import DISARMED, HELD, HOLD, MANEUVER, OPERATOR, WRENCH, FaultOutcome, Judge

READY_S = 4.0
FROM_S = {MANEUVER: 24.0, HOLD: 14.0, OPERATOR: 14.0, DISARMED: 6.0}
AFTER_S = {MANEUVER: 16.0, HOLD: 12.0, OPERATOR: 12.0, DISARMED: 4.0}
"""A maneuver that a guard ends holds for eight seconds before it reports it."""
WITHIN_S = 6.0
"""A fault comes when it flies: in a maneuver on the first plateau."""
LASTS_S = 9999.0


@dataclass(frozen=True, slots=True)
class DeviceFault:
    """A row of the table: the device, what is wrong with it, and the name of the fault."""

    who: str
    what: str
    fault: str
    lasts_s: float = LASTS_S


LIES = {
    "gyroscope offset": "gyro_offset",
    "accelerometer offset": "force_offset",
    "velocity bias": "velocity_bias",
    "frozen velocity": "velocity_frozen",
    "false lock": "false_lock",
    "depth stuck": "depth_stuck",
    "short range": "range_short",
    "turns without thrust": "thruster_fails",
}
"""Faults of what a device measures or does, of which one falls on the vehicle."""
_VEHICLE = load_vehicle(default_vehicle())
ROWS = (
    *(
        DeviceFault(device, *how)
        for device in _VEHICLE.sensors
        for how in (("died", "absent"), ("frozen", "repeated"), ("restarted", "reset", 0.1))
    ),
    *(
        DeviceFault("T3" if fault == "thruster_fails" else FAULTS[fault].devices(_VEHICLE)[0], what, fault)
        for what, fault in LIES.items()
    ),
)


class ModePilot:
    """Flies one mode with the vehicle's own pilot. Once it was disarmed it does not arm again."""

    def __init__(self, mode: str, seed: int) -> None:
        self.vehicle = load_vehicle(default_vehicle())
        self.pilot = Pilot(self.vehicle)
        self.mode, self.goal = mode, Goal(("surge",), seed=seed)
        self.maneuver: ManeuverOutput | None = None
        self.estimated: Navigation | None = None
        self._was_armed = self._ended = False
        self._started_at: Stamp | None = None

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Arm, begin, and go on."""
        stamp, self.estimated = navigation.stamp, navigation.reading
        self._started_at = self._started_at or stamp
        if armed and self.mode == OPERATOR:
            self.pilot.set_operator_wrench(WRENCH, "base_link_fsd", stamp, stamp)
        flight = self.pilot.step(navigation.reading, stamp, became, armed=armed)
        self.maneuver = flight.maneuver
        if armed and not self._was_armed:
            self._begin()
        self._ended = self._ended or (self._was_armed and not armed)
        self._was_armed = self._was_armed or armed
        ready = seconds_between(self._started_at, stamp) >= READY_S
        return LockstepCommand(flight.wrench, armed=ready and self.mode != DISARMED and not self._ended)

    def _begin(self) -> None:
        if self.mode == MANEUVER:
            self.pilot.fly(self.goal)
        elif self.mode == HOLD:
            for axis, value in HELD:
                self.pilot.set(Setpoint(axis, value=value))


def fly(row: DeviceFault, mode: str, seed: int) -> Iterator[FaultOutcome]:
    """Fly, break, and judge every step of the hardware."""
    at_s = random.Random(f"{row} {mode} {seed}").uniform(0.0, WITHIN_S) + FROM_S[mode]  # noqa: S311  # no secret
    pilot = ModePilot(mode, seed)
    fault = FaultSpec(row.fault, (row.who,), at_s, row.lasts_s)
    step = Lockstep(pilot.vehicle, pilot, seed, by_bytes=True, faults=[fault])
    assert isinstance(step.rig, BytesRig)
    hardware, advance, onboard = step.rig.hardware, step.rig.hardware.advance, step.onboard
    judge, lost, unhealthy = Judge(hardware.true_state()), "", ""

    def watch(stamp: Stamp) -> dict[str, bytes]:
        nonlocal judge, lost, unhealthy
        data, true = advance(stamp), hardware.true_state()
        if step.elapsed_s < at_s:
            judge = Judge(true)
            lost = "no thrust before the fault: nothing is shown" if true.neutral and mode != DISARMED else ""
        else:
            judge.observe(true, pilot.estimated)
            unhealthy = unhealthy or next(iter(onboard.unhealthy), "")
        return data

    hardware.advance = watch  # type: ignore[method-assign]
    for _ in step.run(at_s + AFTER_S[mode]):
        pass
    aborted = pilot.maneuver.aborted if pilot.maneuver is not None else ""
    reason = unhealthy or aborted or ("" if judge.flies_on else onboard.reason)
    yield judge.cell(row.who, row.what, mode, seed, reason, lost=lost)
