"""The sentence of every code, once; copies, plain data and files keep the code."""

import copy
import json
import pickle

import pytest

from hindrax_ident.assess.objections import (
    NO_OBJECTION,
    SENTENCES,
    Code,
    Objection,
    objection,
    read_back,
    to_json,
    unnamed,
)

GAIN = {"wanted": 0.2, "influence": "current", "remedy": "wait until the water is still"}
CAUSE = {"influence": "tether", "shown": "2.5 +- 0.4", "unit": "N", "times": 12.3, "remedy": "hold it slack"}
SAID = {
    objection(Code.UNNAMED, sentence="so it is"): "so it is",
    objection(Code.SLOW_VELOCITIES, step_s=100.0): "velocities are 100 s apart: name the unit of the times if it is "
    "not s, such as t_ms",
    objection(Code.FAST_VELOCITIES, step_s=1.16e-6): "velocities are 1.16e-06 s apart: name the unit of the times if "
    "it is not s, such as t_d for days",
    objection(Code.FEW_VELOCITIES, found=3, axis="surge", wanted=20): "the record holds 3 velocities of surge, wanted "
    "20 at least",
    objection(Code.NO_THRUST, kind="moment", axis="yaw"): "the record holds no moment on yaw",
    objection(Code.LATE_THRUST, late_s=0.5): "the first force comes 0.5 s after the last velocity: check the times of "
    "both",
    objection(Code.CONSTANT_THRUST, axis="surge", where=" (on sway it does)"): "the thrust on surge never changes "
    "(on sway it does): nothing was excited",
    objection(Code.CONSTANT_VELOCITY, axis="surge", where=""): "the velocity of surge never changes: it was not "
    "measured, or the vehicle did not move",
    objection(Code.UNSIGNED_VELOCITY, axis="surge"): "the velocity of surge is never below zero, and grows while the "
    "thrust pushes backward: it is a speed without a sign; record the velocity along the axis, or give the speed the "
    "sign of the motion",
    objection(Code.NO_FIT): "no coefficients explain this motion by this force: check axes, signs and times of both",
    objection(Code.UNUSABLE, why="it is too short"): "it is too short",
    objection(Code.NOT_CONVERGED): "the fit did not converge",
    objection(
        Code.WRONG_THRUSTERS, what="T1 pushes the other way", axis="yaw", before=0.004, after=0.98, remedy="mend it"
    ): "T1 pushes the other way, against the vehicle file: the thrust then explains 98% of the changes of yaw, not "
    "0%; mend it",
    objection(Code.FEW_SAMPLES, found=9.94, wanted=10.0): "9.9 independent samples, wanted 10",
    objection(Code.HARDLY_MOVED, speed=0.0123, unit="m/s"): "it hardly moved: speed at most 0.012 m/s, no more than "
    "the noise of one measurement",
    objection(Code.UNEXPLAINED_MOTION, speed=0.27, unit="m/s", explained=0.009): "it moved at up to 0.27 m/s, and this "
    "force explains 0.009 m/s of it: other forces than drag act, or the thrust obeys another law than recorded",
    objection(Code.NO_DRAG, speed=0.45, unit="rad/s", drag=-14.02, force_unit="N m"): "the drag at 0.45 rad/s is -14 "
    "N m, wanted above 0: other forces move it, or the wrench has another sign",
    objection(Code.POORLY_KNOWN_DRAG, share=0.21, **GAIN): "the drag at the highest speed is known to 21.0% only, "
    "wanted 20%, the gain of the thrust left out; most by current: wait until the water is still",
    objection(Code.UNKNOWN_DRAG, share=3.0, **GAIN): "the drag at the highest speed is unknown: its uncertainty is "
    "larger than itself, wanted 20%, the gain of the thrust left out; most by current: wait until the water is still",
    objection(Code.CURRENT, speed=0.45, unit="m/s", current=0.06, share=0.267): "at speeds up to 0.45 m/s a current of "
    "0.06 m/s changes the drag by 27%: k_q and k_l cannot be separated",
    objection(Code.ONE_SPEED, share=0.71): "71% of the motion was at nearly one speed: only the transients separate "
    "k_q from k_l; use the drag with its interval",
    objection(Code.NOT_SEPARATED, low=0.1, high=0.45, unit="m/s", share=0.26): "speeds of 0.1 to 0.45 m/s do not "
    "separate k_q from k_l (either is uncertain by 26% of the drag); use the drag with its interval",
    objection(Code.NEGATIVE_DRAG, name="k_q", shown="-6.1 +- 2.0"): "k_q is negative (-6.1 +- 2.0): other forces than "
    "drag act, or the thrust obeys another law than recorded",
    objection(Code.MASS_BELOW_BODY, sigmas=3.1): "the total mass is 3.1 standard deviations below the body's own: "
    "check the units of force and velocity, and the mass of the vehicle file",
    objection(Code.CONSTANT_FORCE, force_N=2.91, share=0.21): "a constant force of 2.9 N or more, 21% of the largest "
    "drag, acts as well: a current, the tether, or an offset of the thrust",
    objection(Code.POOR_PREDICTION, fit=0.49): "the held-out part of the run is predicted with a fit of only 49%",
    objection(Code.JOINT_NOT_CONVERGED): "the fit of all axes did not converge",
    objection(Code.OTHER_MASS_ALONE, motion="surge", shown="26 +- 3", alone="8.8 +- 1.1"): "the added mass of surge is "
    "26 +- 3 by all axes together and 8.8 +- 1.1 by itself: forces act that this fit does not know; fly one axis after "
    "the other",
    objection(Code.JOINT_UNKNOWN_DRAG, shown="12 +- 7"): "the drag at the highest speed is 12 +- 7: fly it faster or "
    "for longer",
    objection(
        Code.FEW_FREQUENCIES, found=2.1, wanted=3.0
    ): "its thrust has 2.1 frequencies, wanted 3: fly steps, or a chirp",
    objection(Code.UNKNOWN_FORCES, where=" in yaw"): "forces that the model lacks are larger than half of the largest "
    "thrust in yaw: check the direction of each thruster, and the vehicle file",
    objection(Code.AGAINST_THRUST): "it moves against its thrust: check the sign of the wrench, and the axes of both",
    objection(Code.BRAKED_BY_THRUST): "its thrust brakes the motion, as of a controller that holds it: other forces "
    "move it; push on it on purpose, or check the sign of the wrench",
    objection(Code.SWAPPED_VELOCITIES): "thrust along surge moves it along sway, and along sway along surge: check the "
    "axes of velocity and wrench",
    objection(Code.TURNED_VELOCITY, angle_deg=44.7, side="port"): "the velocity points 45 deg to port of the thrust: "
    "the sensor is turned in the hull, or the axes of the wrench are; name its rotation in the vehicle file, or turn "
    "the velocities back",
    objection(Code.IMPLAUSIBLE_SPEED, speed=450.0, unit="m/s"): "speeds of up to 450 m/s: check the units of force "
    "and velocity, and the vehicle file",
    objection(Code.IMPLAUSIBLE_MASS, times=40.2): "the added mass is 40 times the body's own: check the units of force "
    "and velocity, and the vehicle file",
    objection(Code.IMPLAUSIBLE_DRAG, found=1200.0, low=0.03, high=100.0): "the drag coefficient is 1.2e+03, wanted "
    "0.03 to 100: check the units of force and velocity, and the vehicle file",
    objection(Code.AT_BOUND, name="k_l", bound=0.0, unit="N s/m", shown="-1.2 +- 0.8"): "k_l is at its bound, 0 N s/m: "
    "the record alone would make it -1.2 +- 0.8 N s/m",
    objection(Code.SMOOTHED_VELOCITY, smoothing_s=1.04): "the velocity is smoothed, as by a filter of 1 s, which was "
    "undone: record it as the instrument gives it",
    objection(Code.MEAN_VELOCITY, how="a moving mean", mean_s=1.52): "the velocity is smoothed, as by a moving mean "
    "over 1.5 s, which the fit knows: record it as the instrument gives it",
    objection(
        Code.PERHAPS_SMOOTHED, filter_s=0.98
    ): "the velocity looks smoothed, as by a filter of 0.98 s that cannot "
    "be undone here, which is in the uncertainty: record it as the instrument gives it",
    objection(Code.UNEVEN_LAG, goes_s=0.448, turns_s=-0.02): "the lag of the thrust is +0.45 s longer as it goes "
    "than as it comes, -0.02 s as it turns round, which the fit knows",
    objection(Code.RAMPING_THRUST, ramp_s=0.75): "the thrust ramps, 0.75 s from zero to its largest, which the fit "
    "knows: record it behind what limits its rate",
    objection(Code.JOINT_OF_MEANS, how="a moving mean", mean_s=0.98): "the velocity is smoothed, as by a moving mean "
    "over 0.98 s, which the fit of all axes does not know: record it as the instrument gives it",
    objection(
        Code.SLOW_THRUST, lag_s=0.561, wanted_s=0.45
    ): "the thrust acts 0.56 s late in this fit, wanted 0.45 s at "
    "most: the velocities look smoothed; record them as the instrument gives them, or give the lag of the thrusters in "
    "the vehicle file",
    objection(Code.EVIDENCE, **CAUSE): "evidence of tether (2.5 +- 0.4 N): hold it slack",
    objection(Code.UNEXPLAINED_RESIDUALS, **CAUSE): "no influence explains the residuals; the nearest, tether (2.5 +- "
    "0.4 N), is 12 times the size in a pool: it is part of the uncertainty, but hardly the cause",
    objection(Code.UNSEEN, widened="the drag", causes="gain and losses", remedy="weigh it"): "most of the uncertainty "
    "of the drag cannot be observed in the data (gain and losses): weigh it",
    objection(
        Code.OTHER_WEIGHT, shown="2.1 +- 0.1", known_N=1.0, axes=""
    ): "the record has a net buoyancy of 2.1 +- 0.1 N, "
    "mass and volume of the vehicle file 1 N: check mass_kg, volume_m3 and the density of the water",
    objection(Code.OTHER_MASS, shown="10.4 +- 1.9", unit="kg", known=13.5, key="mass_kg"): "the record has a total "
    "mass of 10.4 +- 1.9 kg, less than the body alone has by the vehicle file, 13.5 kg: check its mass_kg, and the "
    "thrust",
    NO_OBJECTION: "",
}


@pytest.mark.parametrize(("found", "sentence"), SAID.items(), ids=[one.code.name for one in SAID])
def test_every_code_has_its_sentence(found: Objection, sentence: str) -> None:
    assert found == sentence


def test_no_code_is_without_a_sentence() -> None:
    assert {one.code for one in SAID} == set(SENTENCES) == set(Code)


def test_a_sentence_without_its_number_is_a_defect() -> None:
    with pytest.raises(KeyError, match="wanted"):
        objection(Code.FEW_SAMPLES, found=9.9)


def test_copies_keep_code_and_numbers() -> None:
    one = objection(Code.ONE_SPEED, share=0.71)
    for other in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert (other, other.code, other.numbers) == (one, Code.ONE_SPEED, {"share": 0.71})
    assert not NO_OBJECTION


def test_plain_data_has_the_code_beside_the_sentence_and_a_file_gives_it_back() -> None:
    given = (objection(Code.NOT_CONVERGED), unnamed("because"))
    plain = to_json("reason", given)
    assert plain == {"reasons": ["the fit did not converge", "because"], "reason_codes": ["not_converged", "unnamed"]}
    assert {type(one) for one in plain["reasons"] + plain["reason_codes"]} == {str}
    again = read_back(*json.loads(json.dumps(plain)).values())
    assert [(one, one.code) for one in again] == [(one, one.code) for one in given]


@pytest.mark.parametrize("codes", [(), ("not_converged",), ("of a later version", "")])
def test_a_file_without_a_known_code_keeps_the_sentence(codes: tuple[str, ...]) -> None:
    found = read_back(("it drifts", "it is odd"), codes)
    assert found == ("it drifts", "it is odd")
    assert {one.code for one in found} == {Code.UNNAMED}
