"""A pool test in lock-step, in a world of one's choice: what was learned of it, what is true, and how it ended.

Fly once, identify often: the `events` of a flight can be pickled and given to `identified` with changed code.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from hindrax_control.maneuver.goal import PLATEAUS, Goal
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.maneuver.plan import Plan
from hindrax_control.pilot import PilotKnobs
from hindrax_core.events import Stamp, to_s
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import truth_of
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_ident.online.aim import Aim
from hindrax_ident.online.experiment import Experiment
from hindrax_ident.online.session import Outcome, Session
from hindrax_sim.conditions.world_table import IDEAL, sizes_of
from hindrax_sim.flights.goal_pilot import GoalPilot
from hindrax_sim.flights.lockstep import Lockstep
from hindrax_sim.world import Conditions, World

LONGEST_S = 7200.0
Watch: TypeAlias = Callable[[World, ManeuverOutput], None]
"""Called in every cycle of a maneuver with the truth and what the maneuver puts out."""


@dataclass(frozen=True, slots=True)
class PoolFlight:
    """One flight: the vehicle as modeled, the world, what identified it, how it ended."""

    vehicle: Vehicle
    world: World
    session: Session
    aborted: str
    plans: tuple[Plan, ...] = ()
    experiment: Experiment | None = None

    @property
    def outcome(self) -> Outcome:
        """What the identification found; computed at every call."""
        return self.session.finalize()

    @property
    def truth(self) -> dict[str, dict[str, float]]:
        """The hull's own coefficients, by motion."""
        return truth_of(self.world.truth.described())

    def drag_N(self, motion: str, speed: float) -> float:
        """The hull's own drag at a signed speed, positive with it [N, Nm]."""
        return self.world.truth.resistance(MOTIONS[motion].axis, speed)


def fly(
    motions: Sequence[str],
    seed: int,
    world: str = IDEAL,
    *,
    vehicle: Vehicle,
    excitation: str = PLATEAUS,
    knobs: PilotKnobs | None = None,
    watch: Watch = lambda _world, _output: None,
    aim: Aim | None = None,
) -> PoolFlight:
    """Fly a goal with the modeled vehicle; `world` as for `--world`, its random sizes are drawn by the same seed.

    With an aim, the identification chooses what is flown.
    """
    vehicle = calibrated(vehicle)
    session = Session(vehicle, silent=True)
    experiment = None if aim is None else Experiment(tuple(motions), aim)
    if experiment is None:
        pilot = GoalPilot(vehicle, Goal(tuple(motions), excitation, seed), knobs)
    else:

        def chosen(now: Stamp) -> Goal | None:
            choice = experiment.next(session, to_s(now))
            return None if choice is None else Goal((choice.motion,), levels=choice.levels)

        pilot = GoalPilot(vehicle, None, knobs, following=chosen, cancel_at_s=experiment.aim.limit_s)
    step = Lockstep(vehicle, pilot, seed, conditions=Conditions(sizes=sizes_of(world, seed)), session=session)
    for event in step.run(LONGEST_S):
        if isinstance(event.reading, Navigation) and pilot.output is not None:
            watch(step.world, pilot.output)
    never = pilot.refused or "start: the maneuver did not begin"
    aborted = pilot.output.aborted if pilot.output is not None else never
    if experiment is not None and aborted.startswith("cancelled: "):
        aborted, _ = "", experiment.next(session, to_s(step.world.stamp))
    return PoolFlight(vehicle, step.world, session, aborted, pilot.plans, experiment)


def calibrated(vehicle: Vehicle) -> Vehicle:
    """Say of every sensor that its accelerometer was calibrated: the lock-step's have the offset that is left then."""
    done = {"accel_offset_mps2": (0.0, 0.0, 0.0)}
    sensors = {
        name: replace(mount, calibration={**done, **mount.calibration}) for name, mount in vehicle.sensors.items()
    }
    return replace(vehicle, sensors=sensors)
