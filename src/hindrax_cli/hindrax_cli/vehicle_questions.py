"""Ten questions about a vehicle, and the vehicle file that their answers make."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hindrax_analysis.exports.vehicle_block import block_text
from hindrax_cli.vehicle_edit import on_one_line
from hindrax_cli.vehicle_review import MARGIN, upright_speed_mps
from hindrax_core.errors import UsageError
from hindrax_core.hydrostatics import GRAVITY_mps2, Water
from hindrax_core.sensor_table import SENSORS, Capability
from hindrax_core.vehicle import Limits, vehicle_from_text
from hindrax_ident.model.empirical_model import Dimensions, empirical, hydrodynamics_of

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


@dataclass(frozen=True, slots=True)
class Question:
    """One question: how many numbers, their bounds, and what an empty line means (nothing: it must be answered)."""

    key: str
    count: int
    low: float
    high: float
    text: str
    usual: Callable[[Answers], Sequence[float]] | Sequence[float] = ()

    def _usual(self, answers: Answers) -> tuple[float, ...]:
        return tuple(self.usual(answers) if callable(self.usual) else self.usual)

    def read(self, line: str, answers: Answers) -> tuple[float, ...]:
        """Numbers of a line; UsageError with what was found and what was wanted."""
        words = line.replace(",", " ").split()
        if not words and (usual := self._usual(answers)):
            return usual
        try:
            found = tuple(float(word) for word in words)
        except ValueError:
            found = ()
        if len(found) != self.count or not all(self.low <= one <= self.high for one in found):
            wanted = f"{self.count} number{'s' if self.count > 1 else ''} from {self.low:g} to {self.high:g}"
            wanted += ", with decimal points" if "," in line else ""
            raise UsageError(f"{self.text}: found {line.strip() or 'nothing'!r}, wanted {wanted}")
        if self.key == "layout" and found[0] not in LAYOUTS:
            raise UsageError(f"{self.text}: found {line.strip()!r}, wanted one of {', '.join(map(str, LAYOUTS))}")
        return found

    def prompt(self, answers: Answers) -> str:
        """The question with its usual answer."""
        usual = " ".join(f"{one:g}" for one in self._usual(answers))
        return f"{self.text} [{usual}]:" if usual else f"{self.text}:"


def _across(answers: Answers) -> tuple[float, float]:
    length, width, _ = answers["size"]
    return (round(SPREAD * length, 3), round(SPREAD * width, 3))


def _upright(answers: Answers) -> tuple[float, float]:
    ahead, across = (round(INWARDS * one, 3) for one in _across(answers))
    return (0.0 if answers["layout"][0] == 6 else ahead, across)  # a row of LAYOUTS


def _below(answers: Answers) -> tuple[float, float, float]:
    return (0.0, 0.0, round(0.5 * answers["size"][2], 3))


APART = "front to rear and port to starboard"
ORIGIN = "the center of the envelope: forward, starboard, down"
ROWS = "; ".join(f"{n}: {text}" for n, text in LAYOUTS.items())
QUESTIONS = (
    Question("mass", 1, 0.1, 1e5, "1. mass in kg, dry, trimmed as it flies"),
    Question("buoyancy", 1, -1e4, 1e4, "2. pull in N on a scale when held under water, floating is positive", (1.0,)),
    Question("size", 3, 0.01, 50.0, "3. length, width, height in m"),
    Question("layout", 1, 0, 8, f"4. thrusters ({ROWS})", (6,)),
    Question("angle", 1, 1.0, 89.0, "5. angle in degrees of the vectored thrusters off the x axis", (45.0,)),
    Question("vectored", 2, 0.0, 50.0, f"6. distance in m of the vectored thrusters, {APART}", _across),
    Question("vertical", 2, 0.0, 50.0, f"7. distance in m of the vertical thrusters, {APART}", _upright),
    Question("thrust", 1, 0.1, 1e4, "8. thrust in N of one thruster at full command", (30.0,)),
    Question("dvl", 3, -50.0, 50.0, f"9. position in m of the DVL from {ORIGIN}", _below),
    Question("pool", 3, 0.5, 1e4, "10. pool: length, width, depth in m", (10.0, 6.0, 1.8)),
)


def ask(line_of: Callable[[str], str], on_wrong: Callable[[UsageError], None]) -> Answers:
    """Put the questions; `line_of` shows a prompt and returns the line that was typed.

    After an invalid answer `on_wrong` raises, or prints it and the question is repeated; the end of the input raises.
    """
    answers: dict[str, tuple[float, ...]] = {}
    for question in QUESTIONS:
        if question.key in ("angle", "vectored", "vertical", "thrust") and answers["layout"] == (0.0,):
            continue
        while question.key not in answers:
            line = line_of(question.prompt(answers))
            if not line:
                raise UsageError(
                    f"{question.text}: found 'nothing', the input has ended; wanted an answer to each question"
                )
            try:
                answers[question.key] = question.read(line, answers)
            except UsageError as error:
                on_wrong(error)
    return answers


def file_text(name: str, answers: Answers) -> str:
    """Vehicle file: what was answered, and for the rest assumptions that are marked as such."""
    (mass_kg,), (pull_N,), size = answers["mass"], answers["buoyancy"], answers["size"]
    density = Water().density_kgpm3
    volume_m3 = (mass_kg + pull_N / GRAVITY_mps2) / density
    if volume_m3 <= 0.0:
        raise UsageError(f"a vehicle of {mass_kg:g} kg that pulls {pull_N:g} N displaces nothing; check both")
    length, width, height = size
    known: dict[str, Any] = {
        "name": name,
        "mass_kg": mass_kg,
        "volume_m3": float(f"{volume_m3:.6g}"),
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
    if MARGIN * upright_mps < Limits().speed_mps:
        limit = _dump({"limits": {"speed_mps": float(f"{MARGIN * upright_mps:.2g}")}})
        parts += ["\n# Nothing controls pitch: beyond this it would no longer right itself.", limit.rstrip()]
    return "\n".join([*parts, ""])


def _thrusters(answers: Answers) -> list[dict[str, Any]]:
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


def _curve(full_N: float) -> dict[str, Any]:
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


def _dump(block: dict[str, Any]) -> str:
    """YAML with a line for each thruster, sensor and curve."""
    return "".join(_entry(key, value) for key, value in block.items())


def _entry(key: str, value: Any) -> str:
    if isinstance(value, list) and isinstance(value[0], dict):
        return f"{key}:\n" + "".join(f"  - {on_one_line(row)}\n" for row in value)
    if isinstance(value, dict) and isinstance(next(iter(value.values())), dict):
        return f"{key}:\n" + "".join(f"  {name}: {on_one_line(row)}\n" for name, row in value.items())
    return f"{key}: {on_one_line(value)}\n"
