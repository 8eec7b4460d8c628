"""The file of coefficients: what is written is read back, and a broken file is named."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hindrax_analysis.coefficients_file import as_yaml, coefficients_of, conditions_of, read_coefficients
from hindrax_analysis.exports.export_model import export_model
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.objections import Code, objection, unnamed
from hindrax_ident.assess.results import Corrected, DragBand, MotionResult, Number, Results

CORRECTED = Corrected(61.0123456789, (58.5, 63.5), (54.0, 64.0))


def a_result(motion: str = "surge", *, identifiable: bool = True) -> MotionResult:
    numbers = {
        "k_q": Number(66.4812345678901, 0.21, 1.35, 66.48, "N s^2/m^2", CORRECTED),
        "k_l": Number(1.25, 0.06, math.nan, None, "N s/m"),
        "b": Number(-0.02, 0.004, 0.004, None, "N"),
    }
    speed = array(np.linspace(0.1, 0.4, 5))
    return MotionResult(
        motion=motion,
        method="output-error",
        coefficients=numbers,
        names=("k_q", "k_l", "b"),
        covariance=np.diag([0.21**2, 0.06**2, 0.004**2]),
        covariance_corrected=9.0 * np.diag([0.21**2, 0.06**2, 0.004**2]),
        samples=100,
        effective_samples=80.0,
        identifiable=identifiable,
        reasons=() if identifiable else (unnamed("it hardly moved: 0.01 # at most"), objection(Code.NOT_CONVERGED)),
        speeds=(0.1, 0.4),
        quality={"lag_s": 0.12, "latency_s": -0.01, "residual_std": 0.004},
        drag=DragBand(speed, 66.48 * speed**2, 0.1 * speed, 0.3 * speed),
    )


@pytest.fixture
def saved(tmp_path: Path, vehicle: Vehicle) -> Path:
    results = Results({"surge": a_result(), "yaw": a_result("yaw", identifiable=False)}, vehicle)
    file = tmp_path / "run" / "coefficients.yaml"
    file.parent.mkdir()
    file.write_text(as_yaml(results, conditions_of(vehicle, mock=True, motions=("surge", "yaw"))), encoding="utf-8")
    return file


def test_numbers_come_back_to_the_last_digit(saved: Path) -> None:
    found = read_coefficients(saved)
    surge = found.motions["surge"]
    assert surge.coefficients["k_q"] == Number(66.4812345678901, 0.21, 1.35, 66.48, "N s^2/m^2", CORRECTED)
    assert np.array_equal(surge.covariance_corrected, 9.0 * surge.covariance)
    assert math.isnan(surge.coefficients["k_l"].std_calibrated)
    assert surge.speeds == (0.1, 0.4)
    assert surge.quality == {"lag_s": 0.12, "latency_s": -0.01, "residual_std": 0.004}
    assert not found.motions["yaw"].identifiable
    reasons = found.motions["yaw"].reasons
    assert reasons == ("it hardly moved: 0.01 # at most", "the fit did not converge")
    assert [one.code for one in reasons] == [Code.UNNAMED, Code.NOT_CONVERGED]


def test_numbers_behind_a_fit_may_be_missing_and_are_numbers() -> None:
    numbers = {"k_q": {"value": 1.0, "std": 0.1}, "quality": {"lag_s": None}}
    assert coefficients_of({"motions": {"surge": numbers}}, "c.yaml").motions["surge"].quality == {}
    for broken, message in (({"lag_s": "much"}, r"quality\.lag_s: found 'much', wanted a number"), ([], "found list")):
        with pytest.raises(HindraxError, match=message):
            coefficients_of({"motions": {"surge": numbers | {"quality": broken}}}, "c.yaml")


def test_conditions_come_back(saved: Path, vehicle: Vehicle) -> None:
    reported = read_coefficients(saved).conditions
    assert reported.vehicle == vehicle.name
    assert reported.mock
    assert reported.motions == ("surge", "yaw")
    assert reported.kinematic_viscosity_m2ps == vehicle.water.kinematic_viscosity_m2ps


def test_the_run_is_called_by_its_folder(saved: Path) -> None:
    assert read_coefficients(saved).label == "run"


def test_the_exports_read_the_same_file(saved: Path, vehicle: Vehicle) -> None:
    made = export_model(read_coefficients(saved), vehicle, str(saved), complete=True).hydrodynamics
    assert made.surge.k_q == 61.0123456789, "as it is quoted"
    assert vehicle.hydrodynamics is not None
    assert made.yaw == vehicle.hydrodynamics.yaw


def test_words_stand_beside_the_numbers(saved: Path) -> None:
    text = saved.read_text()
    assert "k_q = 61.0 +- 2.5 (95 %: 54 to 64) N s^2/m^2" in text
    assert "k_l = 1.250 +- 0.060 N s/m" in text, "without a correction it is the fit"
    assert "yaw: NOT identifiable" in text


def test_a_run_without_motions_is_a_file_too(tmp_path: Path, vehicle: Vehicle) -> None:
    file = tmp_path / "coefficients.yaml"
    file.write_text(as_yaml(Results({}, vehicle), conditions_of(vehicle, mock=False)), encoding="utf-8")
    assert read_coefficients(file).motions == {}


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("motions: [", "is not YAML"),
        ("a: 1", "no mapping 'motions'"),
        ("motions: {surge: {k_q: 3}}", "motions.surge.k_q"),
        ("motions: {surge: {k_q: {value: .inf, std: 1}}}", "motions.surge.k_q.value"),
        ("motions: {surge: {speeds: [1]}}", "motions.surge.speeds"),
        ("motions: {surge: 3}", "motions.surge"),
        ("motions: {surge: {reasons: 3}}", "motions.surge.reasons: found 3, wanted a list"),
        ("motions: {surge: {reasons: it hardly moved}}", "motions.surge.reasons: found 'it hardly moved'"),
        ("{motions: {}, conditions: {assumptions: 7}}", "conditions.assumptions: found 7, wanted a list"),
    ],
)
def test_a_broken_file_is_named(tmp_path: Path, text: str, named: str) -> None:
    file = tmp_path / "coefficients.yaml"
    file.write_text(text)
    with pytest.raises(HindraxError, match=r"coefficients\.yaml") as caught:
        read_coefficients(file)
    assert named in str(caught.value)


def test_a_list_that_a_person_left_empty_is_empty(tmp_path: Path) -> None:
    file = tmp_path / "coefficients.yaml"
    file.write_text("conditions: {motions: }\nmotions: {surge: {identifiable: false, reasons: }}\n")
    found = read_coefficients(file)
    assert (found.motions["surge"].reasons, found.conditions.motions) == ((), ())


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(HindraxError, match="cannot be read"):
        read_coefficients(tmp_path / "none.yaml")


BOUNDS = "pool_bounds: 0.4 m to the wall; give it room"


def an_aborted_file(path: Path, vehicle: Vehicle, motions: dict[str, Any]) -> Path:
    reported = replace(
        conditions_of(vehicle, mock=True, motions=tuple(motions)), aborted=BOUNDS, flown_s={"surge": 20.04}
    )
    reported = replace(reported, predicted={"surge": 0.0412})
    file = path / "coefficients.yaml"
    file.write_text(as_yaml(Results(motions, vehicle), reported), encoding="utf-8")
    return file


def test_an_aborted_run_reports_it_first_and_is_read_back(tmp_path: Path, vehicle: Vehicle) -> None:
    file = an_aborted_file(tmp_path, vehicle, {"surge": a_result()})
    assert next(iter(yaml.safe_load(file.read_text()).items())) == ("aborted", BOUNDS)
    reported = read_coefficients(file).conditions
    assert (reported.aborted, reported.flown_s, reported.predicted) == (BOUNDS, {"surge": 20.0}, {"surge": 0.0412})


def test_a_run_to_its_end_and_an_older_file_are_not_aborted(saved: Path) -> None:
    data = yaml.safe_load(saved.read_text())
    assert "aborted" not in data
    del data["conditions"]["flown_s"]
    saved.write_text(yaml.safe_dump(data), encoding="utf-8")
    reported = read_coefficients(saved).conditions
    assert (reported.aborted, reported.flown_s) == ("", {})


def test_an_aborted_run_in_which_nothing_was_flown_reports_it(tmp_path: Path, vehicle: Vehicle) -> None:
    file = an_aborted_file(tmp_path, vehicle, {})
    assert "# Nothing was flown" in file.read_text()
    assert read_coefficients(file).motions == {}
    with pytest.raises(HindraxError, match=r"aborted by pool_bounds: .* and no motion of that is identifiable"):
        export_model(read_coefficients(file), vehicle, str(file))


def test_an_export_of_an_aborted_run_reports_it(tmp_path: Path, vehicle: Vehicle) -> None:
    file = an_aborted_file(tmp_path, vehicle, {"surge": a_result()})
    notes = export_model(read_coefficients(file), vehicle, str(file), complete=True).notes
    assert notes[0] == f"aborted by {BOUNDS}; the results are of the part flown until then"


def test_thrusters_that_were_left_out_come_back(vehicle: Vehicle, tmp_path: Path) -> None:
    out = ("T3: 82 % of its thrust is missing, left out from 18 s on",)
    file = tmp_path / "coefficients.yaml"
    conditions = replace(conditions_of(vehicle, mock=True), left_out=out)
    file.write_text(as_yaml(Results({}, vehicle), conditions), encoding="utf-8")
    assert read_coefficients(file).conditions.left_out == out
