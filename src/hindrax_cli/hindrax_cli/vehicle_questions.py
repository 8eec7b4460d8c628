"""Ten questions about a vehicle, and the vehicle file that their answers make."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hindrax_cli.vehicle_edit import on_one_line
from hindrax_cli.vehicle_plausibility import (
    ANGLE,
    FORCE,
    LENGTH,
    MASS,
    PLAUSIBLE,
    Implausible,
    Units,
    hull_objection,
    implausible,
    likely_unit,
    mount_outside,
    outside,
    pull_objection,
    thrust_objection,
)
from hindrax_cli.vehicle_review import RIGHTING_MARGIN, upright_speed_mps
from hindrax_core.errors import UsageError
from hindrax_core.hydrostatics import GRAVITY_mps2, Water
from hindrax_core.readings import Vec3
from hindrax_core.sensor_table import SENSORS, Capability
from hindrax_core.text.coded import Coded
from hindrax_core.vehicle import Limits, vehicle_from_text

RIGHTING_ARM_m = 0.05
SPREAD = 0.8
"""Distance of thrusters on opposite sides over the size of the envelope, where nothing else is known."""
INWARDS = 0.75
"""Distance of vertical thrusters over that of vectored ones, where nothing else is known: none at one spot."""
STOP_us, DEAD_BAND_us, FULL_us = 1500.0, 25.0, 1100.0
GAIN_SIGMA = 0.1
LAYOUTS = {0: "none yet", 6: "four vectored, two vertical", 8: "four vectored, four vertical"}
FILLED = 0.8
"""Projected area of an open frame over that of its box."""
HEAD = """# {name}: made by `./hindrax vehicle new`. SI units; body axes x forward, y starboard, z down.
# Positions from the center of the envelope. docs/reference/vehicle-file.md lists every key."""
PORTS: Mapping[Capability, str] = {
    "velocity": "/dev/hindrax/dvl",
    "range": "/dev/hindrax/ping",
    "rates": "/dev/i2c-1",
    "depth": "/dev/i2c-1",
}
"""Ports of the usual sensors: of each the first of the table that measures it."""
ASSUMED = "# Assumed: an open frame fills 0.8 of its box; center of buoyancy 50 mm above the center of mass."
ESTIMATED = "# Estimated from the dimensions: prior of plans, truth of the mock; never given to the estimator."
Answers = Mapping[str, tuple[float, ...]]
BACK = "<"
"""Answer that returns to the question before."""
Bounds = tuple[float, float]


def _agrees(_: Answers) -> Coded[Implausible]:
    return PLAUSIBLE


@dataclass(frozen=True, slots=True)
class Question:
    """One question: bounds of its numbers, how they must agree with earlier answers, and what an empty line means."""

    key: str
    bounds: tuple[Bounds, ...]
    """Of each number."""
    text: str
    usual: Callable[[Answers], Sequence[float]] | Sequence[float] = ()
    """Meaning of an empty line; nothing: it must be answered."""
    objection: Callable[[Answers], Coded[Implausible]] = _agrees
    """Why the answers up to this one do not agree; empty when they do."""
    units: Units = ()
    """Units in which it may have been answered by mistake."""
    against: str = ""
    """Key of the earlier question that may be the wrong one; it is put again too."""

    def suggestion(self, answers: Answers, typed: Answers) -> tuple[float, ...]:
        """Meaning of an empty line: what was typed earlier, else the usual answer where it agrees with the others."""
        usual = tuple(self.usual(answers) if callable(self.usual) else self.usual)
        return typed.get(self.key, usual if usual and not self._problem(usual, answers) else ())

    def numbers(self, line: str, answers: Answers, typed: Answers) -> tuple[float, ...]:
        """Read an answer.

        Parameters
        ----------
        line
            As typed; numbers with spaces or commas between.
        answers, typed
            Of the earlier questions, and all that was typed: what an empty line means.

        Returns
        -------
        tuple[float, ...]
            Empty where the line holds something else.
        """
        try:
            return tuple(float(word) for word in line.replace(",", " ").split()) or self.suggestion(answers, typed)
        except ValueError:
            return ()

    def wrong(self, line: str, found: tuple[float, ...], answers: Answers) -> Coded[Implausible]:
        """Say what was found, what was wanted and the unit that was likely meant.

        Parameters
        ----------
        line, found
            As typed, and its numbers.
        answers
            Of the earlier questions, which it must agree with.

        Returns
        -------
        Coded[Implausible]
            Empty for a good answer.
        """
        problem = self._problem(found, answers, ", with decimal points" if "," in line else "")
        shown = line.strip() or " ".join(f"{one:g}" for one in found)
        if not problem:
            return PLAUSIBLE
        return Coded(
            problem.code,
            f"{self.text}: found {repr(shown) if shown else 'nothing'}, {problem}{self._likely(found, answers)}",
        )

    def _problem(self, found: tuple[float, ...], answers: Answers, hint: str = "") -> Coded[Implausible]:
        if not self.is_within(found):
            count = len(self.bounds)
            ranges = ", ".join(dict.fromkeys(f"{low:g} to {high:g}" for low, high in self.bounds))
            s = "s" if count > 1 else ""
            return implausible(Implausible.NUMBERS, count=count, s=s, ranges=ranges, hint=hint)
        if self.key == "layout" and found[0] not in LAYOUTS:
            return implausible(Implausible.LAYOUT, known=", ".join(map(str, LAYOUTS)))
        return self.objection({**answers, self.key: found})

    def is_within(self, found: tuple[float, ...]) -> bool:
        """Whether it is as many numbers as wanted, each within its bounds."""
        return len(found) == len(self.bounds) and all(
            low <= one <= high for one, (low, high) in zip(found, self.bounds, strict=True)
        )

    def _likely(self, found: tuple[float, ...], answers: Answers) -> str:
        """Sentence that names the unit in which this answer, or the one that it is held against, would be right."""
        if len(found) != len(self.bounds):
            return ""
        if meant := likely_unit(found, self.units, lambda tried: not self._problem(tried, answers)):
            return f"; likely it is in {meant}"
        earlier = next((one for one in QUESTIONS if one.key == self.against), self)
        if earlier is self or not self.is_within(found):
            return ""
        meant = likely_unit(
            answers[earlier.key],
            earlier.units,
            lambda tried: earlier.is_within(tried) and not self._problem(found, {**answers, earlier.key: tried}),
        )
        return f"; likely the {earlier.key} is in {meant}" if meant else ""

    def prompt(self, answers: Answers, typed: Answers) -> str:
        """The question with the meaning of an empty line."""
        shown = " ".join(f"{one:g}" for one in self.suggestion(answers, typed))
        return f"{self.text} [{shown}]:" if shown else f"{self.text}:"


def _size(answers: Answers) -> Vec3:
    length, width, height = answers["size"]
    return (length, width, height)


def _weight_N(answers: Answers) -> float:
    return answers["mass"][0] * GRAVITY_mps2


def _volume_m3(answers: Answers) -> float:
    return (answers["mass"][0] + answers["buoyancy"][0] / GRAVITY_mps2) / Water().density_kgpm3


def _across(answers: Answers) -> tuple[float, float]:
    length, width, _ = answers["size"]
    return (round(SPREAD * length, 3), round(SPREAD * width, 3))


def _upright(answers: Answers) -> tuple[float, float]:
    ahead, across = (round(INWARDS * one, 3) for one in _across(answers))
    return (0.0 if answers["layout"][0] == 6 else ahead, across)  # a row of LAYOUTS


def _below(answers: Answers) -> Vec3:
    return (0.0, 0.0, round(0.5 * answers["size"][2], 3))


def _apart_objection(key: str) -> Callable[[Answers], Coded[Implausible]]:
    def objection(answers: Answers) -> Coded[Implausible]:
        ahead, across = answers[key]
        size = _size(answers)
        far = outside((0.5 * ahead, 0.5 * across), size[:2])
        return implausible(Implausible.OUTSIDE, size=_shown(size)) if far else PLAUSIBLE

    return objection


def _mount_objection(answers: Answers) -> Coded[Implausible]:
    ahead, across, down = answers["dvl"]
    size = _size(answers)
    far = mount_outside((ahead, across, down), size)
    return implausible(Implausible.OUTSIDE, size=_shown(size)) if far else PLAUSIBLE


def _pool_objection(answers: Answers) -> Coded[Implausible]:
    size = _size(answers)
    holds = all(one >= most for one, most in zip(answers["pool"], (max(size[:2]), max(size[:2]), size[2]), strict=True))
    return PLAUSIBLE if holds else implausible(Implausible.POOL, size=_shown(size))


def _shown(size_m: Vec3) -> str:
    return " x ".join(f"{one:g}" for one in size_m)


APART = "front to rear and port to starboard"
ORIGIN = "the center of the envelope: forward, starboard, down"
ROWS = "; ".join(f"{n}: {text}" for n, text in LAYOUTS.items())
APART_BOUNDS = ((0.0, 50.0),) * 2
LARGEST_m = 3.5
"""More than a work-class ROV; estimates of larger plates exceed the ranges of a vehicle file."""
QUESTIONS = (
    Question("mass", ((0.1, 1e5),), "1. mass in kg, dry, trimmed as it flies", units=MASS),
    Question(
        "buoyancy", ((-1e5, 1e5),), "2. pull in N on a scale when held under water, floating is positive", (1.0,),
        lambda answers: pull_objection(answers["buoyancy"][0], _weight_N(answers)), FORCE, "mass",
    ),
    Question(
        "size", ((0.01, LARGEST_m),) * 3, "3. length, width, height in m", (),
        lambda answers: hull_objection(_volume_m3(answers), _size(answers)), LENGTH, "mass",
    ),
    Question("layout", ((0, 8),), f"4. thrusters ({ROWS})", (6,)),
    Question(
        "angle", ((1.0, 89.0),), "5. angle in degrees of the vectored thrusters off the x axis", (45.0,), units=ANGLE
    ),
    Question(
        "vectored", APART_BOUNDS, f"6. distance in m of the vectored thrusters, {APART}", _across,
        _apart_objection("vectored"), LENGTH, "size",
    ),
    Question(
        "vertical", APART_BOUNDS, f"7. distance in m of the vertical thrusters, {APART}", _upright,
        _apart_objection("vertical"), LENGTH, "size",
    ),
    Question(
        "thrust", ((0.01, 1e5),), "8. thrust in N of one thruster at full command", (30.0,),
        lambda answers: thrust_objection(answers["thrust"][0], _weight_N(answers)), FORCE, "mass",
    ),
    Question(
        "dvl", ((-50.0, 50.0),) * 3, f"9. position in m of the DVL from {ORIGIN}", _below,
        _mount_objection, LENGTH, "size",
    ),
    Question(
        "pool", ((1.0, 1e3), (1.0, 1e3), (0.5, 6e3)), "10. pool: length, width, depth in m", (10.0, 6.0, 1.8),
        _pool_objection,
    ),
)  # fmt: skip


def ask(
    line_of: Callable[[str], str],
    on_wrong: Callable[[UsageError], None],
    earlier: Answers | None = None,
    on_answer: Callable[[Answers], None] = lambda _: None,
) -> Answers:
    """Put the questions.

    After an invalid answer the question is put again, with the earlier one that it does not agree with. What was typed,
    now or `earlier`, stands in brackets then.

    Parameters
    ----------
    line_of
        Shows a prompt and returns the line that was typed.
    on_wrong
        Raises, or prints the error.
    earlier
        What was typed in an earlier start.
    on_answer
        Gets all that was typed, after each answer.

    Returns
    -------
    Answers
        Numbers by the key of their question.

    Raises
    ------
    UsageError
        At the end of the input.
    """
    answers: dict[str, tuple[float, ...]] = {}
    typed = dict(earlier or {})
    while question := next((one for one in QUESTIONS if one.key not in answers and _is_put(one, answers)), None):
        line = line_of(question.prompt(answers, typed))
        if not line:
            ended = implausible(Implausible.ENDED)
            raise UsageError(Coded(ended.code, f"{question.text}: {ended}"))
        if line.strip() == BACK:
            answers.pop(next(reversed(answers), ""), None)
            continue
        found = question.numbers(line, answers, typed)
        if wrong := question.wrong(line, found, answers):
            on_wrong(UsageError(wrong))
            if question.is_within(found):  # alone it could be right
                answers.pop(question.against, None)
        else:
            answers[question.key] = found
        if line.strip() and question.is_within(found):
            typed[question.key] = found
            on_answer(typed)
    return answers


def _is_put(question: Question, answers: Answers) -> bool:
    """Whether a question has a meaning after the earlier answers."""
    return question.key not in ("angle", "vectored", "vertical", "thrust") or answers["layout"] != (0.0,)


def kept_answers(file: Path) -> Answers:
    """Answers that an unfinished start has left in a file; none where it left none that can be read."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        return {one.key: tuple(map(float, data[one.key])) for one in QUESTIONS if one.key in data}
    except (OSError, ValueError, TypeError):
        return {}


def file_text(name: str, answers: Answers) -> str:
    """Vehicle file: what was answered, and for the rest assumptions that are marked as such."""
    # The other uses of a vehicle file need no SciPy.
    from hindrax_analysis.exports.vehicle_block import block_text  # noqa: PLC0415
    from hindrax_ident.model.empirical_model import Dimensions, empirical, hydrodynamics_of  # noqa: PLC0415

    (mass_kg,), size, density = answers["mass"], answers["size"], Water().density_kgpm3
    length, width, height = size
    known: dict[str, object] = {
        "name": name,
        "mass_kg": mass_kg,
        "volume_m3": float(f"{_volume_m3(answers):.6g}"),
        "envelope_m": list(size),
    }
    known["pool"] = dict(zip(("length_m", "width_m", "depth_m"), answers["pool"], strict=True))
    positions = {"velocity": list(answers["dvl"]), "range": [0.0, 0.0, 0.5 * height]}
    usual = {measured: next(row.name for row in SENSORS if measured in row.measures) for measured in PORTS}
    known["sensors"] = {
        device: {"device": device, "port": PORTS[measured], "position_m": positions.get(measured, [0.0] * 3)}
        for measured, device in usual.items()
    }
    if answers["layout"] != (0.0,):
        known |= {"thrusters": _thrusters(answers), "curves": {"main": _curve(*answers["thrust"])}}
    front, side, top = (float(f"{FILLED * one:.3g}") for one in (height * width, length * height, length * width))
    body = Dimensions(length, width, height, mass_kg, front, side, top, density, RIGHTING_ARM_m)
    prior = block_text(hydrodynamics_of(empirical(body)))
    assumed = {"projected_areas_m2": [front, side, top], "center_of_buoyancy_m": [0.0, 0.0, -RIGHTING_ARM_m]}
    parts = [HEAD.format(name=name), _dump(known), ASSUMED, _dump(assumed), ESTIMATED, prior.rstrip()]
    upright_mps = upright_speed_mps(vehicle_from_text("\n".join(parts), name)) if "thrusters" in known else math.inf
    if RIGHTING_MARGIN * upright_mps < Limits().speed_mps:
        limit = _dump({"limits": {"speed_mps": float(f"{RIGHTING_MARGIN * upright_mps:.2g}")}})
        parts += ["\n# Nothing controls pitch: beyond this it would no longer right itself.", limit.rstrip()]
    return "\n".join([*parts, ""])


def _thrusters(answers: Answers) -> list[dict[str, object]]:
    """T1 to T4 vectored (front port, front starboard, rear port, rear starboard), then those that push up."""
    (angle,), corners = answers["angle"], ((1, -1), (1, 1), (-1, -1), (-1, 1))
    (ahead, across), (above_ahead, above_across) = answers["vectored"], answers["vertical"]
    turns = (angle, -angle, 180.0 - angle, angle - 180.0)
    made = [
        {"position_m": [0.5 * x * ahead, 0.5 * y * across, 0.0], "azimuth_deg": turn}
        for (x, y), turn in zip(corners, turns, strict=True)
    ]
    upright = ((0, -1), (0, 1)) if answers["layout"] == (6.0,) else corners
    made += [
        {"position_m": [0.5 * x * above_ahead, 0.5 * y * above_across, 0.0], "elevation_deg": 90.0} for x, y in upright
    ]
    return [{"name": f"T{index + 1}", "channel": index} | one for index, one in enumerate(made)]


def _curve(full_N: float) -> dict[str, object]:
    """A parabola from the stop pulse to full thrust astern, mirrored: F = -T ((P0 - P) / (P0 - P1))^2."""
    start = STOP_us - DEAD_BAND_us
    scale = full_N / (STOP_us - FULL_us) ** 2
    c = [-scale * STOP_us**2, 2.0 * scale * STOP_us, -scale, 0.0]
    return {
        "source": "assumed: a parabola to full thrust, mirrored; calibrate the thrusters (docs/how-to)",
        "negative": {"c": [float(f"{one:.9g}") for one in c], "from_us": FULL_us, "to_us": start},
        "stop_us": STOP_us,
        "dead_band_us": DEAD_BAND_us,
        "gain_sigma": GAIN_SIGMA,
    }


def _dump(block: Mapping[str, object]) -> str:
    """YAML with a line for each thruster, sensor and curve."""
    return "".join(_entry(key, value) for key, value in block.items())


def _entry(key: str, value: object) -> str:
    if isinstance(value, list) and isinstance(value[0], dict):
        return f"{key}:\n" + "".join(f"  - {on_one_line(row)}\n" for row in value)
    if isinstance(value, dict) and isinstance(next(iter(value.values())), dict):
        return f"{key}:\n" + "".join(f"  {name}: {on_one_line(row)}\n" for name, row in value.items())
    return f"{key}: {on_one_line(value)}\n"
