"""A vehicle that rocks while it is switched on knows its attitude all the same, and how well, before it may arm."""

import math

import pytest
from vehicles_beside import vehicle_beside

from hindrax_core.signals import Navigation
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.physics.plant import LONGEST_STEP_S

VEHICLE = vehicle_beside()
PERIOD_S = 2.8
"""Of the Hindrax's own swing: 3 N m per rad of buoyancy on about 0.6 kg m^2."""


class Idle:
    def step(self, _navigation: object, _became: object, *, armed: bool) -> LockstepCommand:
        del armed
        return LockstepCommand()


def rocking(roll_deg: float, pitch_deg: float, phase: float, seed: int = 5) -> Lockstep:
    """A vehicle let go at an angle, a share of its period before the sensors are switched on."""
    step = Lockstep(VEHICLE, Idle(), seed)
    plant = step.world.plant
    plant.place((plant.x, plant.y, plant.z), (math.radians(roll_deg), math.radians(pitch_deg), 0.0))
    for _ in range(round(phase * PERIOD_S / LONGEST_STEP_S)):
        plant.step(LONGEST_STEP_S)
    return step


def tilt_error_deg(step: Lockstep, state: Navigation) -> float:
    """Angle between the true vertical and the believed one, to the first order."""
    (roll, pitch, _), (true_roll, true_pitch, _) = state.attitude_rad, step.world.attitude_rad
    return math.degrees(math.hypot(roll - true_roll, pitch - true_pitch))


@pytest.mark.parametrize("phase", [0.0, 0.2, 0.35, 0.5, 0.75])
@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(3.0, 0.0), (0.0, 8.0), (10.0, 10.0)])
def test_a_rocking_start_leaves_no_error(roll_deg: float, pitch_deg: float, phase: float) -> None:
    step = rocking(roll_deg, pitch_deg, phase)
    heaves, errors = [], []
    for event in step.run(14.0):
        if isinstance(event.reading, Navigation) and step.elapsed_s > 10.0:
            errors.append(tilt_error_deg(step, event.reading))
            heaves.append(abs(event.reading.velocity_mps[2]))
    assert max(errors) < 1.0
    assert max(heaves) < 0.1


def test_a_quiet_start_knows_its_offset_in_two_seconds() -> None:
    step = rocking(0.0, 0.0, 0.0)
    errors = [tilt_error_deg(step, one.reading) for one in step.run(8.0) if isinstance(one.reading, Navigation)]
    assert step.elapsed_s > 7.9
    assert len(errors) > 300
    assert max(errors) < 0.6
