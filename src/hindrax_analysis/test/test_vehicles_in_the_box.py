"""Vehicles that come with the stack: each flies in mock what its thrusters serve, and is identified."""

from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_analysis.identification.montecarlo import trial_of
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.goal import ServableMotions, motions_to_fly
from hindrax_control.maneuver.plan import PlanKnobs
from hindrax_control.pilot import PilotKnobs
from hindrax_core.thrust.curves import running
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.flights.pool_flight import fly

FILES = sorted(default_vehicle().parent.glob("*.yaml"))
SHORT = PlanKnobs(levels=1, turning_levels=1, repeats=(1, 1, 1, 1, 1, 1), plateau_s=6.0, hover_s=4.0)
OTHERS = [file for file in FILES if file != default_vehicle()]


def test_each_has_the_name_of_its_file_and_states_what_it_cannot_fly() -> None:
    unservable = {file.stem: [motion for motion, _ in served(file).left_out] for file in FILES}
    assert unservable == {"bluerov2": ["pitch"], "bluerov2-heavy": [], "hindrax": [], "lbv": ["roll", "pitch"]}
    assert [load_vehicle(file).name for file in FILES] == [file.stem for file in FILES]


def served(file: Path) -> ServableMotions:
    return motions_to_fly(("all",), load_vehicle(file))


T200_14V8_N = {1100: -36.7, 1200: -24.45, 1300: -12.93, 1400: -4.23, 1460: -0.53}
T200_14V8_N |= {1540: 0.68, 1600: 5.30, 1700: 16.28, 1800: 31.03, 1900: 47.19}
"""Blue Robotics, T200 public performance data of September 2019, between the sheets of 14 and 16 V."""


@pytest.mark.parametrize("name", ["bluerov2", "bluerov2-heavy"])
def test_the_curve_of_the_t200_is_that_of_its_public_table(name: str) -> None:
    curve = load_vehicle(default_vehicle().parent / f"{name}.yaml").curves["main"]
    at_14V8 = running(curve, 14.8)
    for pulse, force_N in T200_14V8_N.items():
        branch = at_14V8.negative if force_N < 0.0 else at_14V8.positive
        # What a knot that was left out may cost, and the last digit of a sheet's forces: 0.01 kgf.
        assert branch.force_N(pulse) == pytest.approx(force_N, rel=0.015, abs=0.1)
    # Full thrust and dead band of the sheet of 12 V; a 16 V cubic would say 17 % too much at 1560 us.
    at_12V = running(curve, 12.0)
    assert at_12V.range_N == pytest.approx((-28.60, 36.42), abs=0.1)
    assert at_12V.dead_us == (1464.0, 1536.0)


@pytest.mark.parametrize(
    ("file", "world"),
    [(one, "ideal" if one.stem == "bluerov2-heavy" else "pool") for one in OTHERS],
    ids=lambda part: part if isinstance(part, str) else part.stem,
)
def test_each_flies_all_it_can_and_its_drag_is_within_its_band(file: Path, world: str) -> None:
    vehicle = load_vehicle(file)
    motions = served(file).flown
    flight = fly(motions, 3, world, vehicle=vehicle, knobs=PilotKnobs(plan=SHORT))
    assert flight.aborted == ""
    assert flight.world.box.wall_hits == 0
    trial = trial_of(3, flight.outcome, flight.truth, flight.drag_N)
    assert {one.motion.partition("_")[0] for one in trial.drag} == set(motions)
    assert max(abs(one.error / one.std_calibrated) for one in trial.drag) < 3.0
    assert [one.motion for one in trial.drag if world == "ideal" and one.share == 1.0 and abs(one.error) > 0.02] == []


def test_a_vehicle_without_a_dvl_flies_what_its_other_sensors_measure() -> None:
    vehicle = load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml")
    blind = replace(vehicle, sensors={name: one for name, one in vehicle.sensors.items() if name != "dvl75"})
    flight = fly(("heave",), 3, "pool", vehicle=blind, knobs=PilotKnobs(plan=SHORT))
    assert flight.aborted == ""
    assert flight.world.box.wall_hits == 0
    trial = trial_of(3, flight.outcome, flight.truth, flight.drag_N)
    assert {one.motion for one in trial.drag} == {"heave_down", "heave_up"}
    assert max(abs(one.error / one.std_calibrated) for one in trial.drag) < 3.0
