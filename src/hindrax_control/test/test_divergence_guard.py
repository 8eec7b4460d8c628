"""What turns against its thrusters is found within tenths of a second, by name; what they cannot hold is not."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from hindrax_control.allocation.divergence_guard import DivergenceGuard
from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import stamp_from_s
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle

VEHICLES = Path(__file__).parents[2] / "hindrax_bringup/vehicles"
STEP_S = 0.02
GAIN, DAMPING = 6.0, 2.5
KICK_radps = 0.05
"""What the first correction answers."""


@dataclass(slots=True)
class Turning:
    """A rigid body that is held upright by its thrusters, whose forces have a `gain` each.

    `outside`: an outer moment that sets in within a second [N m]; `sink_N`, `push_N`: of each vertical and level
    thruster, besides; `turn_Nm`: about the vertical, instead of a held heading; `drag_times`, `righting_times`: of its
    file; `seen`: sign of each axis as it is measured; `wanted`: roll of the hold [rad].
    """

    vehicle: Vehicle
    gains: Mapping[str, float] = field(default_factory=dict)
    outside: tuple[float, float, float] = (0.0, 0.0, 0.0)
    seen: tuple[float, float, float] = (1.0, 1.0, 1.0)
    wanted: float = 0.0
    sink_N: float = 0.0
    push_N: float = 0.0
    turn_Nm: float = 0.0
    drag_times: float = 1.0
    righting_times: float = 1.0
    tilt_deg: float = 0.0
    time_s: float = 0.0

    def fly(self, seconds: float) -> str:
        """Returns the first finding, when `time_s` and `tilt_deg` are those of that moment."""
        B = effectiveness(self.vehicle)[3:]
        found = prior_dynamics(self.vehicle)
        freedoms = [found[axis] for axis in AXES[3:]]
        inertia = np.array([one.inertia for one in freedoms])
        gains = np.array([self.gains.get(one.name, 1.0) for one in self.vehicle.thrusters])
        ahead = effectiveness(self.vehicle)
        besides_N = self.sink_N * ahead[2] + self.push_N * np.sign(ahead[0])
        lags_s = np.array([one.lag_s for one in self.vehicle.thrusters])
        guard, seen, allocate = DivergenceGuard(self.vehicle), np.array(self.seen), np.linalg.pinv(B)
        angles, rates, thrust = np.zeros(3), np.full(3, KICK_radps), np.zeros(len(gains))
        while self.time_s < seconds:
            error = np.array([self.wanted, 0.0, 0.0]) - seen * angles
            moment = GAIN * error - DAMPING * seen * rates
            moment[2] = self.turn_Nm or moment[2]
            forces = np.clip(allocate @ moment + besides_N, -20.0, 20.0)
            thrust = thrust + (forces - thrust) * -np.expm1(-STEP_S / lags_s)
            outside = np.array(self.outside) * min(1.0, self.time_s)
            righting = self.righting_times * np.array([one.restoring for one in freedoms]) * np.sin(angles)
            drag = [self.drag_times * one.drag_force(rate) for one, rate in zip(freedoms, rates, strict=True)]
            rates = rates + STEP_S * (B @ (gains * thrust) - righting - drag + outside) / inertia
            angles, self.time_s = angles + STEP_S * rates, self.time_s + STEP_S
            self.tilt_deg = max(self.tilt_deg, float(np.degrees(np.abs(angles[:2]).max())))
            measured = Navigation(tuple(seen * angles), tuple(seen * rates), (0.0,) * 3, 1.0, 1.0, (0.0, 0.0), True)
            why = guard.step(measured, stamp_from_s(self.time_s), tuple(forces))
            if why:
                return why
        return ""


@pytest.mark.parametrize("name", ["T5", "T6", "T7", "T8"])
def test_a_vertical_thruster_that_is_reversed_is_named_before_it_capsizes(hindrax: Vehicle, name: str) -> None:
    flight = Turning(hindrax, {name: -1.0}, sink_N=5.0)
    assert f"as if {name} pushed the wrong way round" in flight.fly(10.0)
    assert flight.tilt_deg < 45.0


def test_a_level_thruster_that_is_reversed_is_named(hindrax: Vehicle) -> None:
    flight = Turning(hindrax, {"T3": -1.0}, push_N=8.0)
    assert flight.fly(10.0).endswith("as if T3 pushed the wrong way round")


@pytest.mark.parametrize("axis", range(3))
def test_a_sign_that_is_wrong_is_named(hindrax: Vehicle, axis: int) -> None:
    seen = tuple(-1.0 if axis == one else 1.0 for one in range(3))
    flight = Turning(hindrax, seen=(seen[0], seen[1], seen[2]))
    assert f"the sign of {AXES[3 + axis]} were wrong" in flight.fly(10.0)
    assert flight.tilt_deg < 45.0


@pytest.mark.parametrize(
    "flight",
    [
        {"outside": (3.0, -2.0, 4.0)},
        {"gains": {"T5": 0.0}, "outside": (1.0, 0.0, 0.0)},
        {"gains": {"T1": 0.0, "T6": 0.5}, "outside": (1.0, 1.0, 2.0)},
        {"gains": {f"T{number}": 0.7 for number in range(1, 9)}, "outside": (2.0, 0.0, 2.0)},
        {"wanted": 0.87},
        {"wanted": -0.87, "outside": (0.0, 0.7, 0.0)},
        {"turn_Nm": 6.0, "drag_times": 4.3},
    ],
    ids=[
        "held from outside",
        "dead",
        "dead and weak",
        "all weak",
        "rolls as asked",
        "rolls, held",
        "more drag",
    ],
)
def test_what_thrusters_can_master_goes_on(hindrax: Vehicle, flight: dict[str, object]) -> None:
    assert Turning(hindrax, **flight).fly(8.0) == ""  # type: ignore[arg-type]  # fields of the table above


def test_a_vehicle_that_is_more_stable_than_its_file_goes_on() -> None:
    heavy = load_vehicle(VEHICLES / "bluerov2-heavy.yaml")
    assert Turning(heavy, wanted=1.4, righting_times=4.6, sink_N=1.0).fly(8.0) == ""


def test_without_forces_or_rates_nothing_is_found(hindrax: Vehicle) -> None:
    guard = DivergenceGuard(hindrax)
    for turn in range(100):
        tilt = 0.02 * turn
        state = Navigation((tilt, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0,) * 3, 1.0, 1.0, (0.0, 0.0), True)
        assert guard.step(state, stamp_from_s(0.02 * turn), ()) == ""


@pytest.mark.parametrize(
    ("tilt_deg", "pitch_Nm", "push_N", "found"),
    [(42.0, 0.0, 3.0, True), (34.0, 0.0, 3.0, False), (42.0, 0.0, 0.0, False), (42.0, None, 3.0, False)],
    ids=["leans while it pushes ahead", "leans little", "is carried", "leans as asked"],
)
def test_a_slow_lean_against_the_thrusters_ends_as_a_fast_one(
    hindrax: Vehicle, tilt_deg: float, pitch_Nm: float | None, push_N: float, found: bool
) -> None:
    """Two dead thrusters of a diagonal lean a BlueROV2 over by 45 deg in ten seconds, and nothing diverges."""
    pitch = float(np.radians(tilt_deg))
    holds_Nm = prior_dynamics(hindrax)["pitch"].restoring * np.sin(pitch)
    asked = np.array([push_N, 0.0, 0.0, 0.0, holds_Nm if pitch_Nm is None else pitch_Nm, 0.0])
    forces = tuple(np.linalg.pinv(effectiveness(hindrax)) @ asked)
    state = Navigation((0.0, pitch, 0.0), (0.0,) * 3, (0.0,) * 3, 1.0, 1.0, (0.0, 0.0), True)
    guard = DivergenceGuard(hindrax)
    why = [guard.step(state, stamp_from_s(0.02 * turn), forces) for turn in range(1, 70)]
    assert ("leans by 42 deg" in why[-1]) is found


@pytest.mark.parametrize(("braking_radps2", "found"), [(1.5, False), (0.1, True)])
def test_a_maneuver_that_turned_too_far_and_is_brought_back_goes_on(
    hindrax: Vehicle, braking_radps2: float, found: bool
) -> None:
    """Pitch of a pool test overshot to 42 deg by thrust that did less than its file says, and obeyed."""
    freedom, peak_s, peak, missing_radps2 = prior_dynamics(hindrax)["pitch"], 0.5, np.radians(42.0), 2.0
    guard, why = DivergenceGuard(hindrax), []
    for turn in range(1, 30):
        t = 0.02 * turn - peak_s
        pitch, rate = float(peak - 0.5 * braking_radps2 * t * t), -braking_radps2 * t
        known = freedom.restoring * np.sin(pitch) + freedom.drag_force(rate)
        moment = known - freedom.inertia * (braking_radps2 + missing_radps2)
        forces = tuple(np.linalg.pinv(effectiveness(hindrax)) @ np.array([3.0, 0.0, 0.0, 0.0, moment, 0.0]))
        state = Navigation((0.0, pitch, 0.0), (0.0, rate, 0.0), (0.0,) * 3, 1.0, 1.0, (0.0, 0.0), True)
        why.append(guard.step(state, stamp_from_s(0.02 * turn), forces))
    assert any("leans by" in one for one in why) is found


@pytest.mark.parametrize(("push_N", "found"), [(0.0, False), (3.0, True)], ids=["coasts", "pushes ahead"])
def test_a_swing_without_thrust_goes_on_as_far_as_it_goes(hindrax: Vehicle, push_N: float, found: bool) -> None:
    """Of a pool test: a vehicle less stable than its file coasts to 36 deg, and there is no thrust to end."""
    freedom = prior_dynamics(hindrax)["pitch"]
    push = tuple(np.linalg.pinv(effectiveness(hindrax)) @ np.array([push_N, 0.0, 0.0, 0.0, 0.0, 0.0]))
    guard, why = DivergenceGuard(hindrax), []
    pitch, rate = 0.0, 0.9
    for turn in range(1, 100):
        moment = -0.2 * freedom.restoring * np.sin(pitch) - freedom.drag_force(rate)
        rate += 0.02 * moment / freedom.inertia
        pitch += 0.02 * rate
        state = Navigation((0.0, pitch, 0.0), (0.0, rate, 0.0), (0.0,) * 3, 1.0, 1.0, (0.0, 0.0), True)
        why.append(guard.step(state, stamp_from_s(0.02 * turn), push))
    assert any("tilts by" in one for one in why) is found
