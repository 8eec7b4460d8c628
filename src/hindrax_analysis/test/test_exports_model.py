"""Reading a results file for export: complete, passive, honest; and as a table."""

import csv
import io
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_analysis.coefficients_file import MOCK_WORLD, coefficients_of
from hindrax_analysis.exports import python_model
from hindrax_analysis.exports.export_model import ExportModel, export_model, header
from hindrax_analysis.exports.tables import result_table, write_csv, write_latex
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Drag, Hydrodynamics, Vehicle

PRIOR = Hydrodynamics((10, 20, 22, 0.2, 0.4, 0.3), *(Drag(7.0, 2.0),) * 6)
VEHICLE = Vehicle("hindrax", 15.22, 0.0153, (0.59, 0.47, 0.40), hydrodynamics=PRIOR)


def drag_at(drag: Drag, speed: float) -> float:
    k_q, k_l = drag.of(backward=speed < 0.0)
    return (k_q * abs(speed) + k_l) * speed


def value(number: float, std: float = 0.1) -> dict[str, float]:
    return {"value": number, "std": std}


def results(**motions: dict[str, Any]) -> dict[str, Any]:
    """Table 3 and Table 6 of the Hindrax, with changes."""
    table = {
        "surge": (66.48, 1.25, 12.08),
        "sway": (75.31, 14.54, 19.43),
        "heave_down": (93.52, 5.26, 22.4),
        "heave_up": (56.57, 11.84, 22.6),
        "roll": (1.29, -0.12, 0.25),
        "pitch": (0.77, -0.13, 0.45),
        "yaw": (0.55, 1.47, 0.35),
    }
    body = {
        m: {"k_q": value(q), "k_l": value(l), "b": value(0.0), "added_mass": value(a)} for m, (q, l, a) in table.items()
    }
    for motion, change in motions.items():
        body[motion] = {**body.get(motion, {}), **change}
    return {"motions": body}


def exported(document: object, *, complete: bool = False) -> ExportModel:
    return export_model(coefficients_of(document, "c.yaml"), VEHICLE, "c.yaml", complete=complete)


def test_heave_keeps_its_two_directions_and_averages_its_added_mass() -> None:
    model = exported(results(heave_up={"added_mass": value(22.6, 0.2)}))
    assert model.hydrodynamics.heave == Drag(93.52, 5.26, 56.57, 11.84)
    assert model.hydrodynamics.added_mass[2] == pytest.approx((22.4 * 4 + 22.6) / 5)
    assert drag_at(model.hydrodynamics.heave, -0.5) == pytest.approx(-(56.57 * 0.25 + 11.84 * 0.5))


@given(st.floats(0.1, 100.0), st.floats(-20.0, 20.0), st.floats(0.1, 2.0))
def test_no_export_can_drive_the_vehicle(k_q: float, k_l: float, top: float) -> None:
    model = exported(results(surge={"k_q": value(k_q), "k_l": value(k_l), "speeds": [0.0, top]}))
    drag = model.hydrodynamics.surge
    assert drag.k_q >= 0.0
    assert drag.k_l >= 0.0
    force = (k_q * top + k_l) * top
    if force >= 0.0:
        assert drag_at(drag, top) == pytest.approx(force)
    if k_l < 0.0:
        assert any("surge: k_l" in note for note in model.notes)


def test_what_is_missing_is_asked_for_or_taken_from_the_vehicle_and_reported() -> None:
    lacking = results(pitch={"identifiable": False, "reasons": ["it hardly moved", "it is short"]})
    with pytest.raises(HindraxError, match=r"motion pitch is not identifiable \(it hardly moved\); name a --vehicle"):
        exported(lacking)
    without = {"motions": {name: body for name, body in lacking["motions"].items() if name != "pitch"}}
    with pytest.raises(HindraxError, match="no motion pitch in the results; name a --vehicle"):
        exported(without)
    model = exported(lacking, complete=True)
    assert model.hydrodynamics.pitch == Drag(7.0, 2.0)
    assert model.hydrodynamics.added_mass[4] == 0.4
    printed = "pitch: not identifiable in the results (it hardly moved); drag and added mass are from the vehicle file"
    assert printed in model.notes


def test_what_is_reported_of_several_axes_is_reported_once() -> None:
    surge = {"motions": {"surge": results()["motions"]["surge"]}, "aborted": "pool_box"}
    notes = exported(surge, complete=True).notes
    assert notes[0].startswith("aborted by pool_box")
    absent = "not in the results; drag and added mass are from the vehicle file"
    assert notes[1] == f"sway, heave, roll, pitch, yaw: {absent}"
    assert sum(absent in note for note in notes) == 1


def test_bands_and_assumptions_go_with_the_numbers() -> None:
    reported = results(surge={"k_q": {"value": 18.0, "std": 0.5, "std_calibrated": 1.9}})
    world = f"{MOCK_WORLD}: tether 0.524 N, current 0.00998 m/s"
    reported["conditions"] = {"assumptions": ["the gain is believed to within 10%", world]}
    lines = header(exported(reported), ())
    assert any(MOCK_WORLD in line for line in lines)
    assert not any("0.524" in line for line in lines), "the sizes stand in the file that is named"
    assert any("surge: k_q 18.0 +- 1.9 N s^2/m^2" in line for line in lines)
    assert any("assumed: the gain is believed" in line for line in lines)


def test_drag_by_the_speed_across_goes_into_the_models_that_can_have_it() -> None:
    model = exported(results(surge={"k_w": value(80.0)}, yaw={"k_w": value(-0.2)}))
    assert model.across == (80.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    notes = "; ".join(model.notes)
    assert "surge: the drag by the speed across, k_w, is in the Python and the MuJoCo model only" in notes
    assert "yaw: drag by the speed across, k_w = -0.2, would drive the vehicle; taken as zero" in notes
    space: dict[str, Any] = {"__name__": "exported"}
    exec(python_model.write(model), space)  # the file stands on its own: what it does is asked
    # 0.3 along and 0.4 m/s across: 80 (0.5 - 0.3) 0.3 N beside the drag along.
    surge, heaving = (space["drag"](one)[0] for one in ([0.3, 0.0, 0.0, 0, 0, 0], [0.3, 0.0, 0.4, 0, 0, 0]))
    assert surge == pytest.approx((66.48 * 0.3 + 1.25) * 0.3)
    assert heaving == pytest.approx(surge + 80.0 * 0.2 * 0.3)


def test_missing_added_mass_is_asked_for() -> None:
    lacking = results(roll={"added_mass": None})
    with pytest.raises(HindraxError, match="motion roll: no added mass"):
        exported(lacking)
    assert exported(lacking, complete=True).hydrodynamics.added_mass[3] == 0.2


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (None, "no mapping 'motions'"),
        ({"motions": 3}, "no mapping 'motions'"),
        ({"motions": {"surge": 3}}, r"motions\.surge: found 3"),
        ({"motions": {"surge": {"k_q": 3}}}, r"motions\.surge\.k_q: found 3, wanted a mapping with value and std"),
        (
            {"motions": {"surge": {"k_q": {"value": "x"}}}},
            r"motions\.surge\.k_q\.value: found 'x', wanted a finite number",
        ),
    ],
)
def test_a_bad_results_file_is_refused_with_its_key_path(document: object, message: str) -> None:
    with pytest.raises(HindraxError, match=message):
        coefficients_of(document, "c.yaml")


def test_both_negative_is_refused() -> None:
    with pytest.raises(HindraxError, match="both drive the vehicle"):
        exported(results(yaw={"k_q": value(-1.0), "k_l": value(-1.0)}))


def test_a_results_file_of_the_session_is_understood() -> None:
    """Numbers with unit, truth and two deviations, a range of speeds, and what else a session says."""
    number = {"value": 66.4, "std": 0.3, "std_calibrated": 1.3, "truth": 66.48, "unit": "N s^2/m^2"}
    surge = {
        "k_q": number,
        "speeds": [-0.45, 0.4],
        "identifiable": True,
        "reasons": [],
        "names": ["k_q"],
        "quality": {},
    }
    motion = coefficients_of({"motions": {"surge": surge}}, "c.yaml").motions["surge"]
    k_q = motion.coefficients["k_q"]
    assert (motion.value("k_q"), k_q.std, k_q.std_calibrated) == (66.4, 0.3, 1.3)
    assert exported(results(surge=surge)).top_speed[0] == 0.45
    unknown = {**surge, "k_q": {"value": 66.4, "std": float("nan")}, "speeds": []}
    motion = coefficients_of({"motions": {"surge": unknown}}, "c.yaml").motions["surge"]
    assert exported(results(surge=unknown)).top_speed[0] == VEHICLE.limits.speed_mps
    assert math.isnan(motion.coefficients["k_q"].std_calibrated)


def test_a_result_for_both_directions_of_heave_is_exported_and_an_unknown_motion_is_named() -> None:
    """Of a file that a person wrote; both ended with a KeyError."""
    heave = {"k_q": value(80.0), "k_l": value(8.0), "added_mass": value(22.5)}
    others = {name: body for name, body in results()["motions"].items() if not name.startswith("heave")}
    assert exported({"motions": others | {"heave": heave}}).hydrodynamics.heave == Drag(80.0, 8.0)
    named, misnamed = (
        result_table(coefficients_of({"motions": {name: heave}}, "c.yaml"), "c.yaml") for name in ("heave", "heaf")
    )
    assert next(csv.DictReader(io.StringIO(write_csv(named))))["added_mass_unit"] == "kg"
    with pytest.raises(HindraxError, match=r"found the motion 'heaf' in the results, wanted some of surge, .*heave_up"):
        write_csv(misnamed)


def test_tables_carry_values_deviations_and_units() -> None:
    table = result_table(coefficients_of(results(), "c.yaml"), "c.yaml")
    rows = list(csv.DictReader(io.StringIO(write_csv(table))))
    assert [row["motion"] for row in rows][:2] == ["surge", "sway"]
    assert (rows[0]["k_q"], rows[0]["k_q_std"], rows[0]["k_q_unit"]) == ("66.48", "0.1", "N s^2/m^2")
    assert rows[4]["added_mass_unit"] == "kg m^2"
    latex = write_latex(table)
    assert r"surge & $66.48 \pm 0.10$ & $1.25 \pm 0.10$" in latex
    assert latex.count(r"\\") == 8
    odd = results(surge={"k_q": value(66.48, 0.0996), "k_l": value(-0.001, 0.1)})
    assert r"surge & $66.48 \pm 0.10$ & $0.00 \pm 0.10$" in write_latex(
        result_table(coefficients_of(odd, "c.yaml"), "c.yaml")
    )


def test_a_table_without_results_is_refused_with_how_the_flight_ended() -> None:
    aborted = {"aborted": "pool_box: too near", "motions": {}}
    with pytest.raises(HindraxError, match=r"c\.yaml: no motion is identifiable, aborted by pool_box: too near"):
        result_table(coefficients_of(aborted, "c.yaml"), "c.yaml")


def test_the_source_is_named_in_errors() -> None:
    with pytest.raises(HindraxError, match=str(Path("runs") / "c.yaml")):
        coefficients_of({}, str(Path("runs") / "c.yaml"))
