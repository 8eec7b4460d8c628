"""What speaks against a result, or must be known before it is used: a code for programs, a sentence for people.

Every sentence of a verdict stands here once; a remedy that depends on the cause comes from the row of that cause
(`influences`). What is read back from a file keeps the words it was written with. An `Objection` is its sentence, so it
is printed and kept like any other; what decides by it reads `code` and `numbers`, never the words. The words of the
codes are in JSON and in coefficients.yaml (`reason_codes`, `warning_codes`): they are never given to another meaning.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Self

from hindrax_core.text.coded import Coded


class Code(StrEnum):
    """Code of an objection; those of warnings come last."""

    NONE = ""
    UNNAMED = "unnamed"
    """A sentence without a code, as of another version."""

    # ---- the record does not hold the motion at all
    SLOW_VELOCITIES = "slow_velocities"
    FAST_VELOCITIES = "fast_velocities"
    FEW_VELOCITIES = "few_velocities"
    NO_THRUST = "no_thrust"
    LATE_THRUST = "late_thrust"
    CONSTANT_THRUST = "constant_thrust"
    CONSTANT_VELOCITY = "constant_velocity"
    UNSIGNED_VELOCITY = "unsigned_velocity"
    NO_FIT = "no_fit"
    UNUSABLE = "unusable"
    """What the reader or the fit itself said of the record."""

    # ---- the fit of one axis
    NOT_CONVERGED = "not_converged"
    FEW_SAMPLES = "few_samples"
    HARDLY_MOVED = "hardly_moved"
    UNEXPLAINED_MOTION = "unexplained_motion"
    NO_DRAG = "no_drag"
    POORLY_KNOWN_DRAG = "poorly_known_drag"
    UNKNOWN_DRAG = "unknown_drag"
    CURRENT = "current"
    ONE_SPEED = "one_speed"
    NOT_SEPARATED = "not_separated"
    NEGATIVE_DRAG = "negative_drag"
    MASS_BELOW_BODY = "mass_below_body"
    CONSTANT_FORCE = "constant_force"
    POOR_PREDICTION = "poor_prediction"

    # ---- the fit of all axes
    JOINT_NOT_CONVERGED = "joint_not_converged"
    JOINT_UNKNOWN_DRAG = "joint_unknown_drag"
    FEW_FREQUENCIES = "few_frequencies"
    JOINT_OF_MEANS = "joint_of_means"
    SLOW_THRUST = "slow_thrust"
    UNKNOWN_FORCES = "unknown_forces"
    OTHER_MASS_ALONE = "other_mass_alone"

    # ---- numbers that no vehicle has
    WRONG_THRUSTERS = "wrong_thrusters"
    AGAINST_THRUST = "against_thrust"
    BRAKED_BY_THRUST = "braked_by_thrust"
    SWAPPED_VELOCITIES = "swapped_velocities"
    TURNED_VELOCITY = "turned_velocity"
    """A warning where it is turned by little."""
    IMPLAUSIBLE_SPEED = "implausible_speed"
    IMPLAUSIBLE_MASS = "implausible_mass"
    IMPLAUSIBLE_DRAG = "implausible_drag"

    # ---- warnings: the result holds, and this belongs to it
    AT_BOUND = "at_bound"
    SMOOTHED_VELOCITY = "smoothed_velocity"
    MEAN_VELOCITY = "mean_velocity"
    PERHAPS_SMOOTHED = "perhaps_smoothed"
    UNEVEN_LAG = "uneven_lag"
    RAMPING_THRUST = "ramping_thrust"
    EVIDENCE = "evidence"
    UNEXPLAINED_RESIDUALS = "unexplained_residuals"
    UNSEEN = "unseen"
    OTHER_WEIGHT = "other_weight"
    OTHER_MASS = "other_mass"


CAUSES = (Code.EVIDENCE, Code.UNEXPLAINED_RESIDUALS)
"""Warnings by what the residuals of the record hold; `numbers` name the nearest `influence`."""
OF_FITS = (
    *(Code.SMOOTHED_VELOCITY, Code.MEAN_VELOCITY, Code.PERHAPS_SMOOTHED),
    *(Code.UNEVEN_LAG, Code.RAMPING_THRUST),
)
"""Warnings by what a fit found of instrument and thrust."""


_OTHER_LAW = "other forces than drag act, or the thrust obeys another law than recorded"
_WHAT_TO_GAIN = "wanted {wanted:.0%}, the gain of the thrust left out; most by {influence}: {remedy}"
_UNITS = "check the units of force and velocity, and the vehicle file"

SENTENCES: Mapping[Code, str] = {
    Code.NONE: "",
    Code.UNNAMED: "{sentence}",
    Code.SLOW_VELOCITIES: "velocities are {step_s:.3g} s apart: name the unit of the times if it is not s, such as "
    "t_ms",
    Code.FAST_VELOCITIES: "velocities are {step_s:.3g} s apart: name the unit of the times if it is not s, such as t_d "
    "for days",
    Code.FEW_VELOCITIES: "the record holds {found} velocities of {axis}, wanted {wanted} at least",
    Code.NO_THRUST: "the record holds no {kind} on {axis}",
    Code.LATE_THRUST: "the first force comes {late_s:.3g} s after the last velocity: check the times of both",
    Code.CONSTANT_THRUST: "the thrust on {axis} never changes{where}: nothing was excited",
    Code.CONSTANT_VELOCITY: "the velocity of {axis} never changes{where}: it was not measured, or the vehicle did not "
    "move",
    Code.UNSIGNED_VELOCITY: "the velocity of {axis} is never below zero, and grows while the thrust pushes backward: "
    "it is a speed without a sign; record the velocity along the axis, or give the speed the sign of the motion",
    Code.NO_FIT: "no coefficients explain this motion by this force: check axes, signs and times of both",
    Code.UNUSABLE: "{why}",
    Code.NOT_CONVERGED: "the fit did not converge",
    Code.FEW_SAMPLES: "{found:.1f} independent samples, wanted {wanted:.0f}",
    Code.HARDLY_MOVED: "it hardly moved: speed at most {speed:.2g} {unit}, no more than the noise of one measurement",
    Code.UNEXPLAINED_MOTION: "it moved at up to {speed:.2g} {unit}, and this force explains {explained:.2g} {unit} of "
    f"it: {_OTHER_LAW}",
    Code.NO_DRAG: "the drag at {speed:.2g} {unit} is {drag:.3g} {force_unit}, wanted above 0: other forces move it, or "
    "the wrench has another sign",
    Code.POORLY_KNOWN_DRAG: f"the drag at the highest speed is known to {{share:.1%}} only, {_WHAT_TO_GAIN}",
    Code.UNKNOWN_DRAG: f"the drag at the highest speed is unknown: its uncertainty is larger than itself, "
    f"{_WHAT_TO_GAIN}",
    Code.CURRENT: "at speeds up to {speed:.2g} {unit} a current of {current:.2g} m/s changes the drag by {share:.0%}: "
    "k_q and k_l cannot be separated",
    Code.ONE_SPEED: "{share:.0%} of the motion was at nearly one speed: only the transients separate k_q from k_l; use "
    "the drag with its interval",
    Code.NOT_SEPARATED: "speeds of {low:.2g} to {high:.2g} {unit} do not separate k_q from k_l (either is uncertain by "
    "{share:.0%} of the drag); use the drag with its interval",
    Code.NEGATIVE_DRAG: f"{{name}} is negative ({{shown}}): {_OTHER_LAW}",
    Code.MASS_BELOW_BODY: "the total mass is {sigmas:.3g} standard deviations below the body's own: check the units of "
    "force and velocity, and the mass of the vehicle file",
    Code.CONSTANT_FORCE: "a constant force of {force_N:.2g} N or more, {share:.0%} of the largest drag, acts as well: "
    "a current, the tether, or an offset of the thrust",
    Code.POOR_PREDICTION: "the held-out part of the run is predicted with a fit of only {fit:.0%}",
    Code.JOINT_NOT_CONVERGED: "the fit of all axes did not converge",
    Code.JOINT_UNKNOWN_DRAG: "the drag at the highest speed is {shown}: fly it faster or for longer",
    Code.FEW_FREQUENCIES: "its thrust has {found:.1f} frequencies, wanted {wanted:.0f}: fly steps, or a chirp",
    Code.JOINT_OF_MEANS: "the velocity is smoothed, as by {how} over {mean_s:.2g} s, which the fit of all axes "
    "does not know: record it as the instrument gives it",
    Code.SLOW_THRUST: "the thrust acts {lag_s:.2g} s late in this fit, wanted {wanted_s:g} s at most: the velocities "
    "look smoothed; record them as the instrument gives them, or give the lag of the thrusters in the vehicle file",
    Code.UNKNOWN_FORCES: "forces that the model lacks are larger than half of the largest thrust{where}: check the "
    "direction of each thruster, and the vehicle file",
    Code.OTHER_MASS_ALONE: "the added mass of {motion} is {shown} by all axes together and {alone} by itself: forces "
    "act that this fit does not know; fly one axis after the other",
    Code.WRONG_THRUSTERS: "{what}, against the vehicle file: the thrust then explains {after:.0%} of the changes of "
    "{axis}, not {before:.0%}; {remedy}",
    Code.AGAINST_THRUST: "it moves against its thrust: check the sign of the wrench, and the axes of both",
    Code.BRAKED_BY_THRUST: "its thrust brakes the motion, as of a controller that holds it: other forces move it; "
    "push on it on purpose, or check the sign of the wrench",
    Code.SWAPPED_VELOCITIES: "thrust along surge moves it along sway, and along sway along surge: check the axes of "
    "velocity and wrench",
    Code.TURNED_VELOCITY: "the velocity points {angle_deg:.0f} deg to {side} of the thrust: the sensor is turned in "
    "the hull, or the axes of the wrench are; name its rotation in the vehicle file, or turn the velocities back",
    Code.IMPLAUSIBLE_SPEED: f"speeds of up to {{speed:.3g}} {{unit}}: {_UNITS}",
    Code.IMPLAUSIBLE_MASS: f"the added mass is {{times:.0f}} times the body's own: {_UNITS}",
    Code.IMPLAUSIBLE_DRAG: f"the drag coefficient is {{found:.2g}}, wanted {{low:g}} to {{high:g}}: {_UNITS}",
    Code.AT_BOUND: "{name} is at its bound, {bound:g} {unit}: the record alone would make it {shown} {unit}",
    Code.SMOOTHED_VELOCITY: "the velocity is smoothed, as by a filter of {smoothing_s:.2g} s, which was undone: record "
    "it as the instrument gives it",
    Code.MEAN_VELOCITY: "the velocity is smoothed, as by {how} over {mean_s:.2g} s, which the fit knows: record it as "
    "the instrument gives it",
    Code.PERHAPS_SMOOTHED: "the velocity looks smoothed, as by a filter of {filter_s:.2g} s that cannot be undone "
    "here, which is in the uncertainty: record it as the instrument gives it",
    Code.UNEVEN_LAG: "the lag of the thrust is {goes_s:+.2f} s longer as it goes than as it comes, {turns_s:+.2f} s "
    "as it turns round, which the fit knows",
    Code.RAMPING_THRUST: "the thrust ramps, {ramp_s:.2g} s from zero to its largest, which the fit knows: record it "
    "behind what limits its rate",
    Code.EVIDENCE: "evidence of {influence} ({shown} {unit}): {remedy}",
    Code.UNEXPLAINED_RESIDUALS: "no influence explains the residuals; the nearest, {influence} ({shown} {unit}), is "
    "{times:.0f} times the size in a pool: it is part of the uncertainty, but hardly the cause",
    Code.UNSEEN: "most of the uncertainty of {widened} cannot be observed in the data ({causes}): {remedy}",
    Code.OTHER_WEIGHT: "the record has a net buoyancy of {shown} N, mass and volume of the vehicle file {known_N:.3g} "
    "N: check {axes}mass_kg, volume_m3 and the density of the water",
    Code.OTHER_MASS: "the record has a total mass of {shown} {unit}, less than the body alone has by the vehicle file, "
    "{known:.3g} {unit}: check its {key}, and the thrust",
}
"""The sentence of each code, with the numbers behind it and what to do. Remedies of influences are in their table,
`influences.INFLUENCES`."""


class Objection(Coded[Code]):
    """The sentence of an objection, which knows its code and the numbers behind it.

    It is false when there is none (`NO_OBJECTION`).
    """

    __slots__ = ("numbers",)
    numbers: Mapping[str, object]

    def __new__(cls, code: Code, sentence: str, numbers: Mapping[str, object] | None = None) -> Self:
        """Make the sentence of a code; `objection` takes it from the table."""
        made = super().__new__(cls, code, sentence)
        made.numbers = {} if numbers is None else numbers
        return made

    def __getnewargs__(self) -> tuple[Code, str, Mapping[str, object]]:  # type: ignore[override]  # for its copies
        return self.code, str(self), self.numbers


NO_OBJECTION = Objection(Code.NONE, "")


def objection(code: Code, **numbers: object) -> Objection:
    """Return the objection of a code; `numbers`: values of the fields of its sentence, KeyError without one."""
    return Objection(code, SENTENCES[code].format_map(numbers), numbers)


def unnamed(sentence: str) -> Objection:
    """Return the objection of a sentence whose code is not known."""
    return objection(Code.UNNAMED, sentence=sentence)


def read_back(sentences: Sequence[str], codes: Sequence[str] = ()) -> tuple[Objection, ...]:
    """Read what `to_json` wrote; sentences stay as they stand in the file.

    Parameters
    ----------
    sentences : (n,)
        Of reasons or warnings.
    codes : (n,)
        Words of their codes; where another number of them is given, none counts.

    Returns
    -------
    tuple[Objection, ...]
        `UNNAMED` without a code, or with that of a later version; without numbers.
    """
    known = {one.value for one in Code if one is not Code.NONE}
    given = codes if len(codes) == len(sentences) else [""] * len(sentences)
    return tuple(
        Objection(Code(code) if code in known else Code.UNNAMED, text)
        for text, code in zip(sentences, given, strict=True)
    )


def to_json(kind: str, objections: Sequence[Objection]) -> dict[str, list[str]]:
    """Return plain data for JSON and YAML: the sentences as `<kind>s`, and their codes as `<kind>_codes`."""
    return {f"{kind}s": [str(one) for one in objections], f"{kind}_codes": [one.code.value for one in objections]}
