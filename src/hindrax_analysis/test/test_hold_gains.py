"""Gains of a result: knobs within their ranges, robust over its uncertainty, and the same poles in an ArduSub."""

from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_analysis.coefficients_file import coefficients_of
from hindrax_analysis.gains.gain_files import ardusub_file, ardusub_parameters, parameter_file
from hindrax_analysis.gains.hold_gains import HoldGains, hold_gains
from hindrax_control.hold.holds import HoldKnobs
from hindrax_control.hold.station_keeping import StationKeepingKnobs
from hindrax_core.knobs import build
from hindrax_core.vehicle import load_vehicle

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")


def gains_of(relative: float, of_drag: float | None = None) -> HoldGains:
    """Gains of a result that is the vehicle file, known to a part of each coefficient, and of the linear drag."""
    motions: dict[str, Any] = {}
    assert VEHICLE.hydrodynamics is not None
    for index, axis in enumerate(("surge", "sway", "heave", "yaw")):
        k_q, k_l = VEHICLE.hydrodynamics.drag(axis).of(backward=False)
        mass = VEHICLE.hydrodynamics.added_mass[(0, 1, 2, 5)[index]]
        values = {"k_q": k_q, "k_l": k_l, "b": 0.0, "added_mass": mass}
        motions[axis] = {key: {"value": v, "std": relative * abs(v)} for key, v in values.items()}
        if of_drag is not None:
            motions[axis]["k_l"]["std"] = of_drag * k_l
        motions[axis]["speeds"] = [0.2, 0.8]
    saved = coefficients_of({"motions": motions}, "c.yaml")
    return hold_gains(saved, VEHICLE, "c.yaml", complete=True)


@pytest.fixture(scope="module")
def sure() -> HoldGains:
    return gains_of(0.02)


def test_a_result_that_is_less_certain_gives_slower_holds(sure: HoldGains) -> None:
    unsure = gains_of(0.4)
    for axis in ("surge", "heave", "yaw"):
        assert unsure.axes[axis].law.bandwidth_radps < sure.axes[axis].law.bandwidth_radps
        assert sure.axes[axis].margins.sensitivity <= 1.7
    assert sure.drawn == 100


def test_axes_that_were_not_identified_are_named_as_those_of_the_vehicle_file(sure: HoldGains) -> None:
    """Their drag and added mass are the same in every vehicle that was drawn."""
    assert sure.assumed == ("roll", "pitch")
    words = "# roll, pitch: not identified; drag and added mass of the vehicle file, as if they were exact.\n"
    assert words in parameter_file(sure, "c.yaml")
    assert words in ardusub_file(sure, "c.yaml")
    assert "not identified" not in parameter_file(replace(sure, assumed=()), "c.yaml")


def test_a_drag_that_is_hardly_known_makes_a_damped_hold_not_a_slow_one(sure: HoldGains) -> None:
    unsure = gains_of(0.1, of_drag=0.8)
    yaw = unsure.axes["yaw"].law
    assert yaw.damping > 1.0
    assert yaw.bandwidth_radps > 0.5 * sure.axes["yaw"].law.bandwidth_radps
    assert unsure.axes["yaw"].margins.sensitivity <= 1.7
    assert unsure.holds.damping == yaw.damping


def test_the_parameter_file_is_read_back_as_knobs_of_the_pilot(sure: HoldGains) -> None:
    block = yaml.safe_load(parameter_file(sure, "c.yaml"))["/**/pilot"]["ros__parameters"]
    for prefix, kind, wanted in (("holds", HoldKnobs, sure.holds), ("station", StationKeepingKnobs, sure.station)):
        values = {one.name: block[f"{prefix}.{one.name}"] for one in fields(kind)}
        assert build(kind, values, prefix) == wanted  # within the range of every knob
    assert asdict(sure.holds)["climb_mps"] > HoldKnobs().climb_mps


def test_an_ardusub_has_the_same_poles(sure: HoldGains) -> None:
    found = ardusub_parameters(sure)
    yaw = sure.axes["yaw"]
    # Its inner loop: M r' = N RAT_P (ANG_P e - r); with the drag at rest that is K_p e - (K_d + d) r of ours.
    derivative = found["ATC_RAT_YAW_P"] * yaw.thrust
    assert derivative == pytest.approx(yaw.law.derivative, rel=0.01)
    assert found["ATC_ANG_YAW_P"] * derivative == pytest.approx(yaw.law.proportional, rel=0.01)
    heave = sure.axes["heave"]
    thrust_per_mps2 = found["PSC_ACCZ_P"] * 0.1 / 0.5 * heave.thrust
    assert thrust_per_mps2 == pytest.approx(heave.inertia, rel=0.01)
    assert found["PSC_POSZ_P"] * found["PSC_VELZ_P"] * heave.inertia == pytest.approx(heave.law.proportional, rel=0.02)
    text = ardusub_file(sure, "c.yaml")
    assert f"ATC_ANG_YAW_P,{found['ATC_ANG_YAW_P']:g}\n" in text
    assert "PSC_D_ACC_P" in text
