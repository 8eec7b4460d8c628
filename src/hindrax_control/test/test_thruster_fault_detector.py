"""The thruster watch on an ideal vehicle whose thrusters can die, and whose prior can be wrong."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.allocation.thruster_fault_detector import EVERY, SuspectedFault, ThrusterFaultDetector
from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.vehicle import Drag, Vehicle


class Rig:
    """Forces on all thrusters, some of which do nothing; the watch believes `believed`."""

    def __init__(
        self, hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], assumed: Vehicle | None = None, start_s: float = 5.0
    ) -> None:
        self.ideal, self.watch = ideal_vehicle(hindrax, depth_m=0.9), ThrusterFaultDetector(assumed or hindrax)
        self.B, self.start_s = effectiveness(hindrax), start_s
        self.names = [thruster.name for thruster in hindrax.thrusters]

    def fly(
        self,
        forces_of: Callable[[Any], tuple[float, ...]],
        seconds: float,
        dead: tuple[str, ...] = (),
    ) -> tuple[SuspectedFault | None, float]:
        """Fly with forces as a function of time; the dead ones die at `start_s`. Returns who is suspected, and when."""
        alive = np.array([name not in dead for name in self.names], dtype=float)
        while self.ideal.time_s < seconds:
            forces = np.array(forces_of(self.ideal.time_s), dtype=float)
            given = forces * alive if self.ideal.time_s > self.start_s else forces
            found = self.watch.step(self.ideal.navigation(), self.ideal.stamp, forces.tolist())
            if found is not None:
                return found, self.ideal.time_s
            self.ideal.step(tuple(self.B @ given))
        return None, self.ideal.time_s


def wiggle(t: float) -> tuple[float, ...]:
    """Surge with a slow wave in every vertical thruster, idle forces that cancel, and a level trim."""
    wave = 1.5 * math.sin(0.8 * t)
    surge = 3.0 * math.copysign(1.0, math.sin(0.5 * t))
    return (surge + 2, surge + 2, 2 - surge, 2 - surge, 2 + wave, -2 + wave, -2 + wave, 2 + wave)


@pytest.mark.parametrize("dead", ["T1", "T3", "T5", "T8"])
def test_dead_thruster_is_named(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], dead: str) -> None:
    found, at_s = Rig(hindrax, ideal_vehicle).fly(wiggle, 25.0, dead=(dead,))
    assert found is not None
    assert found.name == dead
    assert found.missing > 0.6
    assert found.sentence.startswith(f"{dead}: ")
    assert at_s < 5.0 + 15.0


def test_a_dead_supply_is_found_and_named_as_such(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    def sinking(t: float) -> tuple[float, ...]:
        """A depth hold that nothing answers: it pushes down more and more."""
        down = min(8.0, max(0.0, t - 5.0))
        return (2.0, 2.0, 2.0, 2.0, 2.0 - down, -2.0 - down, -2.0 - down, 2.0 - down)

    rig = Rig(hindrax, ideal_vehicle)
    found, at_s = rig.fly(sinking, 25.0, dead=tuple(rig.names))
    assert found is not None
    assert found.name == EVERY
    assert all(cause in found.sentence for cause in ("supply", "holds it fast", "DVL"))
    assert found.missing == pytest.approx(1.0, abs=0.1)
    assert "supply is dead" in found.sentence
    assert at_s < 5.0 + 10.0
    assert Rig(hindrax, ideal_vehicle).fly(sinking, 10.0)[0] is None, "it is moved as it is pushed"


@pytest.mark.parametrize(("force_N", "found"), [(20.0, False), (36.0, True)])
def test_ballast_does_not_resist_more_than_ballast_can(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], force_N: float, found: bool
) -> None:
    """A vehicle with one vertical thruster that rests: ballast may hold 20 N, but not a quarter of its weight."""
    vertical = replace(hindrax.thrusters[4], position_m=(0.0, 0.0, 0.0))
    rig = Rig(replace(hindrax, thrusters=(*hindrax.thrusters[:4], vertical)), ideal_vehicle, start_s=0.0)
    suspect, _ = rig.fly(lambda _t: (0.0, 0.0, 0.0, 0.0, -force_N), 25.0, dead=tuple(rig.names))
    assert (suspect is not None and suspect.name == EVERY) is found


@pytest.mark.parametrize(("force_N", "found"), [(4.0, False), (8.0, True)])
def test_a_current_does_not_resist_more_than_a_current_can(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], force_N: float, found: bool
) -> None:
    """It holds its place sideways against 0.15 m/s, 4 N, and rests over ground."""
    aside = np.linalg.pinv(effectiveness(hindrax))[:, 1] * force_N
    rig = Rig(hindrax, ideal_vehicle, start_s=0.0)
    suspect, _ = rig.fly(lambda _t: tuple(aside.tolist()), 25.0, dead=tuple(rig.names))
    assert (suspect is not None and suspect.name == EVERY) is found


def test_a_vehicle_that_is_more_stable_than_its_file_is_not_held_fast(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]
) -> None:
    def rolling(t: float) -> tuple[float, ...]:
        """A roll moment, forth and back, that a righting moment holds at a small tilt."""
        roll = 4.0 * math.copysign(1.0, math.sin(0.8 * t))
        return (0.0, 0.0, 0.0, 0.0, roll, -roll, roll, -roll)

    x, y, z = hindrax.center_of_buoyancy_m
    wobbly = replace(hindrax, center_of_buoyancy_m=(x, y, z / 4.6))
    stable = replace(hindrax, center_of_buoyancy_m=(x, y, 2.0 * z))
    assert Rig(stable, ideal_vehicle, replace(wobbly, name="as its file says")).fly(rolling, 30.0)[0] is None


@pytest.mark.parametrize("dead", [False, True], ids=["more drag", "no supply"])
def test_what_turns_against_five_times_the_drag_of_its_file_has_a_supply(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], dead: bool
) -> None:
    turning = np.linalg.pinv(effectiveness(hindrax))[:, 5]

    def forth_and_back(t: float) -> tuple[float, ...]:
        """A yaw moment that is held for seconds, as on a plateau."""
        return tuple((3.0 * math.copysign(1.0, math.sin(0.5 * t)) * turning).tolist())

    known = hindrax.hydrodynamics
    assert known is not None
    assumed = replace(hindrax, hydrodynamics=replace(known, yaw=Drag(known.yaw.k_q / 5.0, known.yaw.k_l / 5.0)))
    rig = Rig(hindrax, ideal_vehicle, assumed)
    found, at_s = rig.fly(forth_and_back, 30.0, dead=tuple(rig.names) if dead else ())
    if not dead:
        assert found is None
        return
    assert found is not None
    assert found.name == EVERY
    assert at_s < 5.0 + 10.0


def test_nobody_is_suspected_while_all_push(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    assert Rig(hindrax, ideal_vehicle).fly(wiggle, 60.0)[0] is None


@pytest.mark.parametrize("factor", [0.6, 1.5])
def test_wrong_prior_is_not_taken_for_a_dead_thruster(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], factor: float
) -> None:
    known = hindrax.hydrodynamics
    assert known is not None
    surge, sway, yaw = (Drag(one.k_q * factor, one.k_l) for one in (known.surge, known.sway, known.yaw))
    assumed = replace(hindrax, hydrodynamics=replace(known, surge=surge, sway=sway, yaw=yaw))
    assert Rig(hindrax, ideal_vehicle, assumed).fly(wiggle, 60.0)[0] is None


@pytest.mark.parametrize("sideways_N", [5.5, 8.0])
def test_losses_of_thrusters_at_work_are_not_taken_for_one_that_is_nearly_idle(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], sideways_N: float
) -> None:
    """A pool test in sway: roll by their losses was taken for a dead T6 of 1 N, then for a dead T5; so it capsized."""

    def sideways(t: float) -> tuple[float, ...]:
        a = sideways_N * math.copysign(1.0, math.sin(0.3 * t))
        return (a - 2, -a - 2, a - 2, -a - 2, -1.5, 1.5, 1.5, -1.5)

    assert Rig(hindrax, ideal_vehicle).fly(sideways, 40.0, dead=("T6",))[0] is None


def test_current_is_not_taken_for_a_dead_thruster(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    rig = Rig(hindrax, ideal_vehicle)
    rig.ideal.current = (0.1, 0.1)
    assert rig.fly(wiggle, 60.0)[0] is None


def test_without_lock_or_motion_nothing_is_judged(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    rig = Rig(hindrax, ideal_vehicle)
    rig.ideal.locked = False
    assert rig.fly(wiggle, 20.0, dead=("T3",))[0] is None
    rig = Rig(hindrax, ideal_vehicle)
    assert rig.fly(lambda _t: (0.0,) * 8, 20.0, dead=("T3",))[0] is None
