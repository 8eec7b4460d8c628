"""Results as data: what is written of them, and the truth of a mock vehicle beside them."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from hindrax_core.vehicle import Drag, Vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.results import (
    Contribution,
    DragBand,
    MotionResult,
    NextStep,
    Number,
    Results,
    truth_of,
    with_truth,
)
from hindrax_ident.remedies import Remedy

COVARIANCE = array(np.array([[4.0, 0.0, -1.0], [0.0, 9.0, 0.0], [-1.0, 0.0, 0.5]]))
"""Of k_q, b and k_l."""
BAND = DragBand(array([0.4]), array([11.0]), array([0.2]), array([0.3]))
RESULT = MotionResult(
    motion="surge",
    method="output-error",
    coefficients={"k_q": Number(66.0, 2.0, 3.0, unit="N s^2/m^2"), "k_l": Number(1.25, 0.7)},
    names=("k_q", "b", "k_l"),
    covariance=COVARIANCE,
    samples=500,
    effective_samples=250.0,
    identifiable=True,
    reasons=(),
    speeds=(0.1, 0.45),
    drag=BAND,
    methods={"plateaus": {"k_q": Number(60.0, 5.0)}},
    budget={"drag": [Contribution("current", 0.3, "wait")]},
    next_step=NextStep(Remedy("wait"), 0.1),
)


def test_what_is_written_is_plain_and_states_null_for_what_nobody_knows() -> None:
    written = json.loads(json.dumps(RESULT.to_json()))
    assert written["k_q"] == {
        "value": 66.0, "std": 2.0, "truth": None, "unit": "N s^2/m^2", "std_calibrated": 3.0,
    }  # fmt: skip
    assert "std_calibrated" not in written["k_l"]
    assert written["drag_force"] == {"speed": [0.4], "force": [11.0], "std": [0.2], "std_calibrated": [0.3]}
    assert (written["identifiable"], written["reasons"], written["speeds"]) == (True, [], [0.1, 0.45])
    assert written["covariance"] == COVARIANCE.tolist()
    assert written["methods"]["plateaus"]["k_q"]["value"] == 60.0
    assert written["budget"] == {"drag": {"current": 0.3}}
    assert written["next_step"] == {"remedy": "wait", "std": 0.1}
    assert yaml.safe_load(yaml.safe_dump(written)) == written, "plain values alone"
    bare = replace(RESULT, drag=None, next_step=None).to_json()
    assert (bare["drag_force"], bare["next_step"]) == (None, None)


@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_the_drag_at_a_speed_has_the_deviation_of_both_coefficients_together(speed: float) -> None:
    force, std = RESULT.drag_force(speed)
    assert force == pytest.approx(math.copysign(66.0 * 0.16 + 1.25 * 0.4, speed))
    assert std == pytest.approx(math.sqrt(4.0 * 0.16**2 + 0.5 * 0.4**2 - 2.0 * 0.16 * 0.4))


def test_the_truth_is_that_of_the_vehicle_file_in_each_direction(vehicle: Vehicle) -> None:
    truth = truth_of(vehicle)
    down, up = truth["heave_down"], truth["heave_up"]
    assert (down["k_q"], down["k_l"], up["k_q"], up["k_l"]) == (93.52, 5.26, 56.57, 11.84)
    assert down["b"] == up["b"] == vehicle.net_buoyancy_N
    assert {name for name, one in truth.items() if one["b"] == 0.0} == {"surge", "sway", "roll", "pitch", "yaw"}
    assert {name for name, one in truth.items() if "k_r" in one} == {"roll", "pitch"}
    assert truth["heave_up"]["added_mass"] == 22.48
    assert truth_of(replace(vehicle, hydrodynamics=None)) == {}
    assert vehicle.hydrodynamics is not None
    alike = replace(vehicle, hydrodynamics=replace(vehicle.hydrodynamics, heave=Drag(90.0, 5.0)))
    assert truth_of(alike)["heave_up"] == truth_of(alike)["heave_down"]
    one_sided = replace(vehicle, hydrodynamics=replace(vehicle.hydrodynamics, surge=Drag(60.0, 1.0, 50.0, 2.0)))
    assert truth_of(one_sided)["surge"]["k_q"] == 60.0


def test_the_truth_stands_beside_what_was_found_and_changes_nothing(vehicle: Vehicle) -> None:
    shown = with_truth(Results({"surge": RESULT, "sway": RESULT}, vehicle), {"surge": {"k_q": 66.48}})
    numbers = shown.motions["surge"].coefficients
    assert (numbers["k_q"].truth, numbers["k_l"].truth) == (66.48, None)
    assert replace(numbers["k_q"], truth=None) == RESULT.coefficients["k_q"]
    assert shown.motions["sway"].coefficients == RESULT.coefficients
    assert shown.to_json()["motions"]["surge"]["k_q"]["truth"] == 66.48
