"""A sensor that begins to lie in flight: no thrust on what it says, judged by the true pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.maneuver import Goal
from hindrax_core.readings import Inertial, Vec3
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.goal_pilot import GoalPilot
from hindrax_sim.lockstep import Lockstep
from hindrax_sim.lockstep_rigs import SensorReading

VEHICLE = load_vehicle(default_vehicle())
AT_S = 25.0


@pytest.mark.parametrize("lie_dps", [(60.0, 0.0, 0.0), (0.0, -40.0, 0.0)])
def test_a_gyroscope_that_lies_ends_thrust_before_the_vehicle_tumbles(lie_dps: Vec3) -> None:
    step = Lockstep(VEHICLE, GoalPilot(VEHICLE, Goal(("surge",))), 3)
    honest, lie = step.rig.advance, tuple(map(math.radians, lie_dps))

    def advance() -> Sequence[SensorReading]:
        heard = honest()
        if step.elapsed_s < AT_S:
            return heard
        return [
            (source, replace(one, reading=replace(one.reading, rate_radps=_sum(one.reading.rate_radps, lie))))
            if isinstance(one.reading, Inertial)
            else (source, one)
            for source, one in heard
        ]

    step.rig.advance = advance
    began = worst_deg = 0.0
    ended_s = math.inf
    for _ in step.run(AT_S + 4.0):
        if step.elapsed_s < AT_S:
            began = max(began, *map(abs, step.world.plant.targets_N))
            continue
        worst_deg = max(worst_deg, *(math.degrees(abs(angle)) for angle in step.world.attitude_rad[:2]))
        if any(step.world.plant.targets_N):
            ended_s = math.inf
        elif math.isinf(ended_s):
            ended_s = step.elapsed_s
    assert began > 1.0, "it flew"
    assert ended_s < AT_S + 2.0
    assert not step.onboard.armed
    assert worst_deg < 50.0


def _sum(one: Vec3, other: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(a + b for a, b in zip(one, other, strict=True))
