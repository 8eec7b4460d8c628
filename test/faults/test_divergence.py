"""A thruster that is wired the wrong way round: in every mode thrust ends before 45 degrees, and it is named."""

import math

import pytest

from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.flights.lockstep import Lockstep
from hindrax_tools.faults.device_faults import FROM_S, ModePilot
from hindrax_tools.faults.fault_outcome import HOLD, MANEUVER, OPERATOR

CASES = ((HOLD, "T5"), (HOLD, "T7"), (OPERATOR, "T8"), (MANEUVER, "T6"), (MANEUVER, "T3"))


def tilted_deg(step: Lockstep) -> float:
    """True angle from upright."""
    roll, pitch, _ = step.world.attitude_rad
    return math.degrees(math.acos(math.cos(roll) * math.cos(pitch)))


@pytest.mark.parametrize(("mode", "name"), CASES)
def test_thrust_ends_before_it_capsizes_and_the_thruster_is_named(mode: str, name: str) -> None:
    pilot = ModePilot(mode, 1)
    fault = parse_fault(f"thruster_reverses:{name}@{FROM_S[mode]}+999")
    step = Lockstep(pilot.vehicle, pilot, 1, faults=[fault])
    thrust_deg = 0.0
    for _ in step.run(FROM_S[mode] + 4.0):
        if step.onboard.armed:
            thrust_deg = max(thrust_deg, tilted_deg(step))
        elif step.onboard.unhealthy:
            break
    assert step.onboard.unhealthy, "never ended"
    assert step.onboard.unhealthy[0].startswith("divergence: ")
    assert f"as if {name} pushed the wrong way round" in step.onboard.unhealthy[0]
    assert thrust_deg < 45.0
