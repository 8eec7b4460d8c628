"""When all axes are fitted together: by the number of axes that a record pushes on at once."""

import math
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from hindrax_analysis.identification import joint_identification
from hindrax_analysis.identification.joint_identification import (
    SEVERAL,
    _before_filters,
    axes_at_once,
    contradicted,
    filters_found,
    identify_jointly,
    lags_found,
    mean_found,
    wants_joint_fit,
)
from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, Span
from hindrax_analysis.records.recording import Recording
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.joint_assessment import JointMotion, JointResults
from hindrax_ident.assess.objections import Code, objection
from hindrax_ident.assess.results import DragBand, MotionResult, Number, Results

T = array(np.arange(0.0, 60.0, 0.05))
EMPTY, EMPTY_ANGLES = array(np.zeros(0)), array(np.zeros((0, 3)))


def pushed(wrench: Array) -> Recording:
    moved = array(np.nan_to_num(wrench))
    return Recording("record", T, moved, T, wrench, array(np.zeros(0)), EMPTY_ANGLES)


def sines(count: int) -> Array:
    """The same sine on so many axes: moments are an axis' own kind, with their own largest."""
    out = np.zeros((len(T), 6))
    out[:, :count] = np.sin(T)[:, None]
    return array(out)


def results(**qualities: dict[str, float]) -> Results:
    """What single axes have found of a filter, by motion."""
    motions = {motion: MotionResult(motion, "", {}, False, quality=found) for motion, found in qualities.items()}
    return Results(motions, load_vehicle(default_vehicle()))


def test_a_filter_of_one_axis_is_that_of_its_instrument() -> None:
    """Of turns only where they show it themselves: rates of a gyroscope are not those of a DVL."""
    none = results(surge={}, roll={"filter_hint_s": 0.7}, yaw={"filter_hint_s": 0.5})
    assert filters_found(none) == {}
    surge = results(surge={"smoothing_s": 1.1}, heave_down={"filter_doubt_s": 0.9}, yaw={"filter_hint_s": 2.3})
    assert filters_found(surge) == {0: 1.1, 1: pytest.approx(1.0), 2: 0.9}
    both = results(surge={"smoothing_s": 1.1}, yaw={"filter_hint_s": 1.0})
    assert filters_found(both) == dict.fromkeys(range(6), 1.1)


def test_filters_of_all_axes_are_undone_before_they_are_fitted_together() -> None:
    record = pushed(sines(6))
    velocity = record.velocity.copy()
    kept = math.exp(-0.05 / 0.8)
    for k in range(1, len(T)):
        velocity[k, :2] = record.velocity[k, :2] + (velocity[k - 1, :2] - record.velocity[k, :2]) * kept
    velocity[::3, 1] = np.nan
    found = _before_filters(replace(record, velocity=array(velocity)), {0: 0.8})
    assert found.velocity[:, 0] == pytest.approx(record.velocity[:, 0], abs=1e-9)
    assert np.array_equal(found.velocity[:, 1:], velocity[:, 1:], equal_nan=True)


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_axes_that_are_pushed_alike_at_the_same_time_are_counted(count: int) -> None:
    assert axes_at_once([pushed(sines(count))]) == pytest.approx(count, rel=0.02)


def test_axes_whose_motion_was_not_measured_are_not_counted() -> None:
    """Surge of thrusters below the center pitches, in a log without rates."""
    record = pushed(sines(6))
    velocity = record.velocity.copy()
    velocity[:, 1:] = np.nan
    assert axes_at_once([replace(record, velocity=array(velocity))]) == pytest.approx(1.0, rel=0.02)


def legs() -> Array:
    out = np.zeros((len(T), 6))
    for axis in range(6):
        mine = (T // 10.0).astype(int) == axis
        out[mine, axis] = (20.0 if axis < 3 else 1.5) * np.sign(np.sin(T[mine]))
    return array(out)


def test_one_axis_after_the_other_is_one_also_while_the_others_are_held() -> None:
    assert axes_at_once([pushed(legs())]) == pytest.approx(1.0, abs=0.01)
    held = legs() + np.array([1.0, 1.0, 8.0, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(1)
    held += rng.standard_normal(held.shape) * np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    assert 1.0 < axes_at_once([pushed(array(held))]) < SEVERAL


def test_a_short_push_in_a_long_record_counts_by_its_size() -> None:
    """By a percentile of the whole record there would be no force, and all of it would be the largest."""
    brief = sines(3) * np.array([1.0, 0.1, 0.1, 0.0, 0.0, 0.0]) * (T > 59.6)[:, None]
    assert axes_at_once([pushed(array(brief))]) == pytest.approx(1.04, abs=0.02)


def test_records_are_pooled_and_forces_that_nobody_knows_push_nothing() -> None:
    known = sines(2)
    known[:, 1] = np.nan
    assert axes_at_once([pushed(known)]) == pytest.approx(1.0, rel=0.02)
    assert axes_at_once([pushed(legs()), pushed(legs())]) == pytest.approx(1.0, abs=0.01)
    assert axes_at_once([pushed(array(np.zeros((len(T), 6))))]) == 0.0


def test_who_flies_several_axes_gets_a_fit_of_all_with_one_sentence() -> None:
    source = RecordSource(Path("a.csv"), pushed(sines(3)))
    wanted, why = wants_joint_fit([source], IdentificationTask())
    assert wanted
    assert "pushes on about 3.0 axes at once" in why
    assert "--no-joint" in why
    assert wants_joint_fit([source], IdentificationTask(axes=(0,))) == (False, "")
    assert wants_joint_fit([RecordSource(Path("a.csv"), pushed(legs()))], IdentificationTask()) == (False, "")
    assert wants_joint_fit([source], IdentificationTask(span=Span(1e3, 2e3))) == (False, "")
    assert wants_joint_fit([RecordSource(Path("bag"))], IdentificationTask()) == (False, "")


MEAN = objection(Code.MEAN_VELOCITY, how="a moving mean", mean_s=1.04)


def test_means_are_no_record_for_a_fit_of_all() -> None:
    """Masses of a pilot's record behind a moving mean of a second were 5 to 7 deviations off, all identified."""
    source, alone = RecordSource(Path("a.csv"), pushed(sines(3))), results(surge={}, heave_down={})
    assert wants_joint_fit([source], IdentificationTask(), alone)[0]
    smoothed = replace(alone.motions["surge"], warnings=(MEAN,))
    known = replace(alone, motions={**alone.motions, "surge": smoothed})
    wanted, why = wants_joint_fit([source], IdentificationTask(), known)
    assert not wanted
    assert why == "the velocities are means over time, which a fit of all axes together does not know: left out"
    assert (mean_found(known).code, mean_found(known).numbers) == (Code.JOINT_OF_MEANS, MEAN.numbers)
    assert not mean_found(alone)


def test_thrust_that_ramps_is_none_for_a_fit_of_all() -> None:
    alone, found = results(surge={}, heave_down={}), objection(Code.RAMPING_THRUST, ramp_s=0.8)
    motions = {**alone.motions, "surge": replace(alone.motions["surge"], warnings=(found,))}
    source = RecordSource(Path("a.csv"), pushed(sines(3)))
    wanted, why = wants_joint_fit([source], IdentificationTask(), replace(alone, motions=motions))
    assert not wanted
    assert why == "the thrust ramps, which a fit of all axes together does not know: left out"


def test_lags_that_differ_are_those_of_the_axes_that_show_it() -> None:
    assert lags_found(results(surge={}, yaw={"lag_s": 0.1})) == (0.0, 0.0)
    shown = [
        {"goes_later_s": goes_s, "turns_later_s": turns_s} for goes_s, turns_s in ((0.1, 0.0), (0.2, 0.1), (0.4, 0.0))
    ]
    assert lags_found(results(surge=shown[0], sway=shown[1], heave_down=shown[2], yaw={})) == (0.2, 0.0)


def test_nothing_of_means_is_identified_by_a_fit_of_all_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is wrong with a thruster is the first to be mended, and stands alone."""
    motions = {name: JointMotion({}, mock.sentinel.drag, (), ()) for name in ("surge", "sway")}
    found = JointResults(motions, EMPTY_ANGLES, EMPTY_ANGLES, {}, {}, converged=True)
    wrong = objection(Code.WRONG_THRUSTERS, what="T1", after=0.9, before=0.1, axis="sway", remedy="mend it")
    monkeypatch.setattr(joint_identification, "fit_jointly", mock.Mock())
    monkeypatch.setattr(joint_identification, "joint_results", lambda *_: found)
    monkeypatch.setattr(joint_identification, "wrong_thrusters", lambda *_: {1: wrong})
    source, vehicle = RecordSource(Path("a.csv"), pushed(sines(3))), load_vehicle(default_vehicle())
    joint = identify_jointly([source], vehicle, IdentificationTask(), against=MEAN)
    assert {name: one.reasons for name, one in joint.motions.items()} == {"surge": (MEAN,), "sway": (wrong,)}


@pytest.mark.parametrize(
    ("mass", "alone", "identifiable", "objects"),
    [
        ((26.4, 2.7), (8.8, 1.1), True, True),
        ((26.4, 2.7), (18.5, 1.1), True, False),
        ((3.0, 0.5), (8.8, 1.1), True, True),
        ((26.4, 2.7), (8.8, 1.1), False, False),
        ((26.4, 2.7), None, True, False),
        (None, (8.8, 1.1), True, False),
    ],
)
def test_a_mass_that_the_axis_by_itself_contradicts_is_not_identified(
    mass: tuple[float, float] | None, alone: tuple[float, float] | None, identifiable: bool, objects: bool
) -> None:
    """A pilot's record in Stonefish had all masses up to 6.6 deviations too high by all axes together, identified."""

    def number(found: tuple[float, float] | None) -> dict[str, Number]:
        return {} if found is None else {"added_mass": Number(found[0], 0.1, found[1], unit="kg")}

    drag = DragBand(EMPTY, EMPTY, EMPTY, EMPTY)
    motions = {name: JointMotion(number(mass), drag, (), ()) for name in ("surge", "sway")}
    joint = JointResults(motions, EMPTY_ANGLES, EMPTY_ANGLES, {}, {}, converged=True)
    own = MotionResult("surge", "", number(alone), identifiable)
    found = contradicted(joint, Results({"surge": own}, load_vehicle(default_vehicle()))).motions
    # Nor are the others: their masses have the same delays.
    for one in found.values():
        assert [reason.code for reason in one.reasons] == [Code.OTHER_MASS_ALONE] * objects
    if objects and mass == (26.4, 2.7):
        assert "surge is 26.4 +- 2.7 by all axes together and 8.8 +- 1.1 by itself" in str(found["sway"].reasons[0])
