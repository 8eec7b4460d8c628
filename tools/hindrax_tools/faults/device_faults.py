"""Faults of devices, in lock-step and by bytes: every emulator, every driver, the whole stack without its processes."""

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hindrax_analysis.coefficients_file import ResultConditions
from hindrax_analysis.report.run_page import RunReport, run_page
from hindrax_bringup.share_files import default_vehicle, share_folder
from hindrax_control.allocation.allocation_cycle import SupplyVoltage
from hindrax_control.hold.holds import Setpoint
from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.pilot import Pilot
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.signals import Allocation, Navigation
from hindrax_core.text.refusals import Reason
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.assess.results import Results
from hindrax_ident.online.session import Session
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.lockstep_rigs import BytesRig
from hindrax_sim.hardware import THRUSTERS
from hindrax_tools.faults.fault_outcome import (
    ARMING,
    BRAKING,
    DISARMED,
    HELD,
    HOLD,
    LONGEST_WRONG_S,
    MANEUVER,
    OPERATOR,
    RECENTRE,
    WEIGHING,
    WRENCH,
    FaultOutcome,
    Judge,
    WORST_THRUST_deg,
    WORST_TILT_deg,
)

READY_S = 4.0
FROM_S = {
    MANEUVER: 24.0,
    **dict.fromkeys((HOLD, OPERATOR, WEIGHING), 14.0),
    DISARMED: 6.0,
    ARMING: 4.0,
    **dict.fromkeys((BRAKING, RECENTRE), 22.0),
}
AFTER_S = {**dict.fromkeys(FROM_S, 12.0), MANEUVER: 16.0, DISARMED: 4.0}
"""A maneuver that a guard ends holds for eight seconds before it reports it."""
WITHIN_S = 6.0
"""A fault comes when it flies: in a maneuver on the first plateau; before, during and after the moment of another."""
TOLD_AFTER_S = 10.0
"""Time after which the operator must know that no thruster pushes, though it flies on."""
LASTS_S = 9999.0
CAPSIZED_deg = 75.0
"""Where thrust ended before 45 degrees, the vehicle still turns on, and comes back upright by itself."""
ORDERED_S = 15.0
"""Time after the arming at which the pilot of `BRAKING` cancels and that of `RECENTRE` restarts its dead reckoning."""


@dataclass(frozen=True, slots=True)
class DeviceFault:
    """A row of the table: the device, what is wrong with it, and the name of the fault."""

    who: str
    what: str
    fault: str
    lasts_s: float = LASTS_S
    worst_deg: float = WORST_TILT_deg
    """True tilt that it may not reach: more where a thruster turns it until thrust ends."""
    also: tuple[str, str] | None = None
    """A second fault at the same moment, and its device."""
    seen_s: float = 0.0
    """How long it is seen at least: what grows slowly needs its time."""
    vehicle: str = ""
    """Name of a vehicle of the box, where it is not the default one; its output is what fails."""
    within_s: float = math.inf
    """Time until neutral that is wanted."""
    given_away: bool = False
    """Whether the vehicle is somebody else's from then on, the autopilot's or another pilot's: nothing that is sent
    from here reaches it, or nothing may be sent. Only `within_s` is judged then, and what is told."""

    def specs(self, at_s: float) -> list[FaultSpec]:
        """Its faults from a time on."""
        both = [(self.fault, THRUSTERS if self.vehicle else self.who), *filter(None, [self.also])]
        return [FaultSpec(fault, (who,), at_s, self.lasts_s) for fault, who in both]


LIES = {
    "gyroscope offset": "gyro_offset",
    "accelerometer offset": "force_offset",
    "velocity bias": "velocity_bias",
    "frozen velocity": "velocity_frozen",
    "stuck velocity": "velocity_stuck",
    "false lock": "false_lock",
    "depth stuck": "depth_stuck",
    "short range": "range_short",
    "turned velocity": "velocity_turned",
    "scaled velocity": "velocity_scaled",
    "scaled depth": "depth_scaled",
    "scaled rates": "gyro_scaled",
    "turned rates": "gyro_turned",
    "frozen rates": "gyro_frozen",
    "scaled range": "range_scaled",
    "frozen range": "range_frozen",
    "dead supply": "supply_dies",
    "turns without thrust": "thruster_fails",
}
"""Faults of what a device measures or does, of which one falls on the vehicle."""
PAIRS = {
    ("died", "absent", "dvl75"): ("absent", "ms5837"),
    ("frozen velocity", "velocity_frozen", "dvl75"): ("repeated", "ms5837"),
    ("stuck velocity", "velocity_stuck", "dvl75"): ("thruster_fails", "T3"),
    ("false lock", "false_lock", "dvl75"): ("range_short", "ping1d"),
    ("died", "absent", "ms5837"): ("absent", "ping1d"),
    ("gyroscope offset", "gyro_offset", "icm20948"): ("absent", "dvl75"),
    ("turns without thrust", "thruster_fails", "T3"): ("velocity_frozen", "dvl75"),
    ("wired backwards", "thruster_reverses", "T6"): ("absent", "ms5837"),
}
"""Faults with a second one that takes the sensor by which the first is found."""
AUTOPILOT, BEHIND_ARDUSUB = "ArduSub", "bluerov2-heavy"
FAILSAFE_S = 3.3
"""ArduSub's FS_PILOT_TIMEOUT, 3 s without a stick, and what was on its way."""
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
    *(DeviceFault(name, "wired backwards", "thruster_reverses", worst_deg=CAPSIZED_deg) for name in ("T3", "T5")),
    DeviceFault("ms5837", "drifts by 1 cm/s", "depth_drifts", seen_s=45.0),
    *(
        DeviceFault(
            who, f"{what}; {other} {also}".replace("_", " "), fault, also=(also, other),
            worst_deg=CAPSIZED_deg if fault == "thruster_reverses" else WORST_TILT_deg,
        )
        for (what, fault, who), (also, other) in PAIRS.items()
    ),
    DeviceFault(AUTOPILOT, "link loses packets", "link_loss", vehicle=BEHIND_ARDUSUB),
    DeviceFault(AUTOPILOT, "link 0.3 s late", "link_delay", vehicle=BEHIND_ARDUSUB),
    DeviceFault(AUTOPILOT, "restarted", "reset", 0.1, vehicle=BEHIND_ARDUSUB),
    DeviceFault(AUTOPILOT, "link cut", "absent", vehicle=BEHIND_ARDUSUB, within_s=FAILSAFE_S, given_away=True),
    DeviceFault(AUTOPILOT, "second ground station", "second_station", vehicle=BEHIND_ARDUSUB, given_away=True),
)  # fmt: skip


class ModePilot:
    """Flies one mode with the vehicle's own pilot. Once it was disarmed it does not arm again."""

    def __init__(self, mode: str, seed: int, vehicle: Vehicle | None = None) -> None:
        self.vehicle = vehicle or load_vehicle(default_vehicle())
        self.pilot = Pilot(self.vehicle)
        self.supply = SupplyVoltage(self.vehicle.supply_V)
        """As the allocation measures it."""
        self.mode, self.goal = mode, Goal(("surge",), seed=seed)
        self.maneuver: ManeuverOutput | None = None
        self.estimated: Navigation | None = None
        self.left_out: dict[str, str] = {}
        """Thrusters that the vehicle has taken out of use itself, with its sentences."""
        self.refused = self.disobeyed = ""
        self._was_armed = self._ended = self._ordered = False
        self._started_at: Stamp | None = None
        self._armed_at = Stamp(0)

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Arm, begin, and go on."""
        stamp, self.estimated = navigation.stamp, navigation.reading
        self._started_at = self._started_at or stamp
        if armed and self.mode == OPERATOR:
            self.pilot.set_operator_wrench(WRENCH, "base_link_fsd", stamp, stamp)
        battery_V = self.supply.battery_V(stamp)
        flight = self.pilot.step(navigation.reading, stamp, became, armed=armed, battery_V=battery_V)
        self.maneuver = flight.maneuver
        self.disobeyed = next((one for one in flight.guards if one.reason is Reason.UNOBEYED), self.disobeyed)
        if (suspect := flight.suspected_fault) is not None:
            self.left_out[suspect.name] = suspect.sentence
            self.pilot.disable(frozenset(self.left_out))
        if armed and not self._was_armed:
            self._armed_at = stamp
            self._begin()
        elif armed and not self._ordered and seconds_between(self._armed_at, stamp) >= ORDERED_S:
            self._ordered = True
            self._order()
        self._ended = self._ended or (self._was_armed and not armed)
        self._was_armed = self._was_armed or armed
        ready = seconds_between(self._started_at, stamp) >= READY_S
        wanted = ready and self.mode != DISARMED and not self._ended
        return LockstepCommand(flight.wrench, armed=wanted, disabled=frozenset(self.left_out))

    def _begin(self) -> None:
        if self.mode in (MANEUVER, BRAKING):
            try:
                self.pilot.fly(self.goal)
            except HindraxError as error:
                self.refused = str(error)
        elif self.mode in (HOLD, ARMING, RECENTRE, WEIGHING):
            for axis, value in WEIGHED if self.mode == WEIGHING else HELD:
                self.pilot.set(Setpoint(axis, value=value))

    def _order(self) -> None:
        if self.mode == BRAKING:
            self.pilot.cancel("hold")
        elif self.mode == RECENTRE:
            self.refused = self.pilot.recentre()


WEIGHED = (*HELD, ("surge", math.nan), ("sway", math.nan))
"""What a weighing holds."""


@dataclass(slots=True)
class Watched:
    """A flight with its faults, as the truth shows it from the first of them on."""

    judge: Judge
    reason: str = ""
    """What the vehicle reported; empty when nothing."""
    lost: str = ""
    thrust: bool = False
    """Whether there was thrust when the first fault came, or later."""
    exit_code: int | None = None
    """Of the command that flew the maneuver, when it has ended; None: there is none, or it goes on."""
    disarmed_thrust_s: float = 0.0
    """The longest thrust in one go after it was disarmed."""
    told: tuple[str, ...] = ()
    """Where the operator is told the reason."""


def watched(pilot: ModePilot, faults: Sequence[FaultSpec], seed: int, until_s: float) -> Watched:
    """Fly in lock-step, by bytes, and judge every step of the hardware from the first fault on."""
    step = Lockstep(pilot.vehicle, pilot, seed, by_bytes=True, faults=faults, session=Session(pilot.vehicle))
    assert isinstance(step.rig, BytesRig)
    hardware, advance, onboard = step.rig.hardware, step.rig.hardware.advance, step.onboard
    pilot.supply = onboard.cycle.supply
    from_s, *later_s = sorted(fault.start_s for fault in faults)
    found, unhealthy, since_s = Watched(Judge(hardware.true_state())), "", math.inf

    def watch(stamp: Stamp) -> dict[str, bytes]:
        nonlocal unhealthy, since_s
        data, true = advance(stamp), hardware.true_state()
        if step.elapsed_s < from_s:
            found.judge = Judge(true)
            found.lost = "no thrust before the fault: nothing is shown" if true.neutral else ""
        else:
            while later_s and step.elapsed_s >= later_s[0]:
                del later_s[0]
                found.judge.broken()
            found.judge.observe(true, pilot.estimated)
            found.thrust = found.thrust or not true.neutral
            disarmed = not onboard.armed and not true.neutral
            since_s = true.now_s if not disarmed or math.isinf(since_s) else since_s
            found.disarmed_thrust_s = max(found.disarmed_thrust_s, true.now_s - since_s)
            unhealthy = unhealthy or next(iter(onboard.unhealthy), "")
        return data

    hardware.advance = watch  # type: ignore[method-assign]
    for _ in step.run(until_s):
        pass
    aborted = pilot.maneuver.aborted if pilot.maneuver is not None else ""
    if pilot.maneuver is not None and pilot.maneuver.done:
        found.exit_code = int(bool(aborted or pilot.left_out))
    ended = "" if onboard.armed else onboard.reason
    left_out = "; ".join(pilot.left_out.values())
    found.reason = onboard.output_fault or unhealthy or aborted or pilot.refused or pilot.disobeyed or left_out or ended
    found.told = ("terminal",) * bool(found.reason)
    if found.exit_code is not None:
        found.told += ("report",) * reported(pilot, aborted) + (f"exit {found.exit_code}",)
    return found


def reported(pilot: ModePilot, aborted: str) -> bool:
    """Whether the page of the run says at its head how the flight ended and which thrusters were left out."""
    conditions = ResultConditions(aborted=aborted, left_out=tuple(pilot.left_out.values()))
    page = run_page(RunReport(Results({}, pilot.vehicle), {}, conditions))
    names = [aborted.partition(":")[0], *pilot.left_out]
    return any(names) and all(name in page for name in names)


def unsaid(found: Watched, mode: str, faults: Sequence[FaultSpec]) -> tuple[str, ...]:
    """What the operator should have been told of a flight and was not, or by a wrong exit code."""
    silent = mode != DISARMED and not found.judge.flies_on and found.thrust and not found.reason
    # The exit code is that of `pool-test`: a thruster left out, or an end that was not planned, is 1.
    good = found.exit_code == 0 and bool(found.reason)
    unreported = found.exit_code == 1 and "report" not in found.told
    powerless = any(one.name == "supply_dies" and one.duration_s > TOLD_AFTER_S for one in faults)
    sentences = {
        "it ended, and nobody is told why": silent,
        "it flies on without power, and nobody is told": powerless and found.thrust and not found.reason,
        f"it ended with 0, though {found.reason}": good,
        f"the report does not say {found.reason}": unreported,
    }
    return tuple(sentence for sentence, so in sentences.items() if so)


def fly(row: DeviceFault, mode: str, seed: int) -> Iterator[FaultOutcome]:
    """Fly, break, and judge every step of the hardware."""
    at_s = random.Random(f"{row} {mode} {seed}").uniform(0.0, WITHIN_S) + FROM_S[mode]  # noqa: S311  # no secret
    faults = row.specs(at_s)
    vehicle = load_vehicle(share_folder("vehicles") / f"{row.vehicle}.yaml") if row.vehicle else None
    found = watched(ModePilot(mode, seed, vehicle), faults, seed, at_s + max(AFTER_S[mode], row.seen_s))
    lost = "" if mode in (DISARMED, ARMING) else found.lost
    untold = unsaid(found, mode, faults)
    if row.given_away and mode != DISARMED and not found.reason:
        untold += ("somebody else has it, and nobody is told",)
    away = math.inf if row.given_away else None
    yield found.judge.cell(
        row.who,
        row.what,
        mode,
        seed,
        found.reason,
        within_s=row.within_s,
        lost=lost,
        worst_deg=away or row.worst_deg,
        longest_wrong_s=away or LONGEST_WRONG_S,
        worst_thrust_deg=away or WORST_THRUST_deg,
        told=found.told,
        unsaid=untold,
    )
