"""`coefficients.yaml`: results of a run and their conditions, for people and programs.

The keys under `motions` are those of the JSON of `pool-test` and `identify`. Comments repeat the results in words;
readers ignore them.
"""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hindrax_core.errors import HindraxError, cause
from hindrax_core.text.digits import measured
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.joint_assessment import JointResults
from hindrax_ident.assess.objections import read_back
from hindrax_ident.assess.results import Contribution, Corrected, MotionResult, Number, Results

KNOWN = ("k_q", "k_l", "b", "k_r", "added_mass", "k_w")
"""Names of coefficients, in display order."""
JOINT = "All axes in one fit: M v' + C(M) v + drag + terms = thrust, M = M_RB + M_A (6 x 6, surge to yaw)."
TABULATED = ("k_q", "k_l", "b", "added_mass")
"""Those that tables, figures and exports have."""


MOCK_WORLD = "the mock's world"
"""Begins the assumption that lists the effects of a mock."""


@dataclass(frozen=True, slots=True)
class ResultConditions:
    """Conditions of a result: vehicle, water, record and software.

    `date` is that of the record (ISO 8601), not of the evaluation; `bag_sha256` is over the files of the bag. `aborted`
    is "guard: sentence" where the flight was aborted, `flown_s` the excitation of each motion [s], where it is known;
    `blocked_s` its thrust without motion, as against a wall [s], which is not in the data; `left_out` thrusters that
    were taken out of use meanwhile, with the reasons; `predicted` the calibrated deviation of its drag at the highest
    speed, as a share of it [-], where a rehearsal predicted it before the flight; `seed` that of
    the mock.
    """

    vehicle: str = ""
    mass_kg: float = math.nan
    volume_m3: float = math.nan
    length_m: float = math.nan
    density_kgpm3: float = math.nan
    kinematic_viscosity_m2ps: float = math.nan
    mock: bool = False
    seed: int | None = None
    motions: tuple[str, ...] = ()
    date: str = ""
    bag: str = ""
    bag_sha256: str = ""
    software: str = ""
    assumptions: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    aborted: str = ""
    flown_s: Mapping[str, float] = field(default_factory=dict)
    blocked_s: Mapping[str, float] = field(default_factory=dict)
    predicted: Mapping[str, float] = field(default_factory=dict)


def conditions_of(vehicle: Vehicle, *, mock: bool, motions: tuple[str, ...] = ()) -> ResultConditions:
    """Conditions of a result by the vehicle file; use `dataclasses.replace` for the rest.

    Parameters
    ----------
    vehicle
        Name, hull and water.
    mock
        Whether the record is one of the simulation.
    motions
        That were flown.

    Returns
    -------
    ResultConditions
        Without bag, date and software.
    """
    hull = vehicle.mass_kg, vehicle.volume_m3, vehicle.envelope_m[0]
    water = vehicle.water.density_kgpm3, vehicle.water.kinematic_viscosity_m2ps
    return ResultConditions(vehicle.name, *hull, *water, mock=mock, motions=motions)


# ---- writing


def document(results: Results, conditions: ResultConditions) -> dict[str, Any]:
    """Plain data of the file: the abort where there was one, conditions, then motions."""
    block = asdict(conditions)
    block |= {"motions": list(conditions.motions), "assumptions": list(conditions.assumptions)}
    block |= {"left_out": list(conditions.left_out)}
    for name in ("flown_s", "blocked_s"):
        block[name] = {motion: round(seconds, 1) for motion, seconds in block[name].items()}
    if conditions.seed is None:
        del block["seed"]
    block["predicted"] = {motion: round(share, 4) for motion, share in conditions.predicted.items()}
    ended = {"aborted": block.pop("aborted")} if conditions.aborted else {}
    return {**ended, "conditions": block, **results.to_json()}


def as_yaml(results: Results, conditions: ResultConditions, joint: JointResults | None = None) -> str:
    """Text of a coefficients.yaml, with comments.

    Parameters
    ----------
    results
        By motion.
    conditions
        Of the record.
    joint
        Results of all axes together, where there are any.

    Returns
    -------
    str
        YAML; the same results give the same text.
    """
    data = document(results, conditions)
    parts = [_head(conditions), _dump({key: data[key] for key in data if key != "motions"}), "\nmotions:\n"]
    for name, result in results.motions.items():
        body = _dump({name: data["motions"][name]})
        parts += ["\n", *(f"  # {line}\n" for line in _in_words(result)), textwrap.indent(body, "  ")]
    if not results.motions:
        parts[-1] = "\n# Nothing was flown: there is no data, so there are no coefficients.\nmotions: {}\n"
    if joint:
        parts += [f"\n# {JOINT}\n", _dump({"joint": joint.to_json()})]
    return "".join(parts)


def _head(conditions: ResultConditions) -> str:
    flown = "of the mock vehicle (simulated)" if conditions.mock else "of a real record"
    lines = (
        f"Hydrodynamic coefficients of {conditions.vehicle}, {flown}.",
        "(m + added_mass) v' = thrust - k_q |v| v - k_l v - b;  SI units; SNAME axes (x forward, y starboard, z down).",
        "k_w, where a record moves across as well: drag k_w (sqrt(v^2 + w^2) - |v|) v by the speed w across.",
        "Drag, added mass and thrust are about the center of mass.",
        "value: of the fit; std: of the noise of this run; std_calibrated: with all influences of the budget as well.",
        "corrected: by the probable size of each influence, with 68 and 95 % intervals: the numbers to quote.",
        "covariance: rows and columns in the order of names (noise of this run only).",
    )
    return "".join(f"# {line}\n" for line in lines) + "\n"


def _dump(data: Mapping[str, object]) -> str:
    return str(yaml.safe_dump(dict(data), sort_keys=False, default_flow_style=None, width=110, allow_unicode=True))


def _in_words(result: MotionResult) -> list[str]:
    verdict = "identified" if result.identifiable else "NOT identifiable: " + "; ".join(result.reasons)
    lines = [f"{result.motion}: {verdict}"]
    for name, number in result.coefficients.items():
        low_high = number.corrected and [f"{end:.4g}" for end in number.corrected.interval95]
        beside = f" (95 %: {' to '.join(low_high)})" if low_high else ""
        lines.append(f"  {name} = {measured(*number.quoted)}{beside} {number.unit}")
    return lines


# ---- reading


@dataclass(frozen=True, slots=True)
class SavedCoefficients:
    """A file read back: of each motion coefficients, verdict, tested speeds; `label` is its name in a comparison."""

    label: str
    conditions: ResultConditions
    motions: Mapping[str, MotionResult]


def as_fitted(saved: SavedCoefficients) -> SavedCoefficients:
    """The results without their corrections: what the motion is for the thrust of the curves, losses included."""
    motions = {
        name: replace(one, coefficients={key: replace(x, corrected=None) for key, x in one.coefficients.items()})
        for name, one in saved.motions.items()
    }
    return replace(saved, motions=motions)


def read_coefficients(file: Path, label: str = "") -> SavedCoefficients:
    """Read a file. HindraxError names the file, the key, what was found and what was wanted."""
    try:
        data = read_yaml(file.read_text(encoding="utf-8"), str(file))
    except (OSError, UnicodeDecodeError) as error:
        wanted = "name a run folder or a coefficients.yaml"
        raise HindraxError(f"{file}: cannot be read ({cause(error)}); {wanted}") from error
    return coefficients_of(data, str(file), label or file.parent.name)


def coefficients_of(data: object, source: str, label: str = "") -> SavedCoefficients:
    """Check the plain data of a file.

    Parameters
    ----------
    data
        As YAML or JSON holds it.
    source
        Name of the file, for errors.
    label
        Its name in a comparison.

    Returns
    -------
    SavedCoefficients
        Files of earlier versions have gaps in their conditions.

    Raises
    ------
    HindraxError
        Names the file, the key, what was found and what was wanted.
    """
    if not isinstance(data, Mapping) or not isinstance(data.get("motions"), Mapping):
        raise HindraxError(f"{source}: no mapping 'motions', wanted a coefficients.yaml of a pool test or of identify")
    motions = {str(name): _motion(str(name), body, source) for name, body in data["motions"].items()}
    return SavedCoefficients(label, _conditions(data, source), motions)


def _conditions(data: Mapping[str, object], source: str) -> ResultConditions:
    """Conditions of a file; older files have gaps."""
    block = data.get("conditions")
    block = block if isinstance(block, Mapping) else {}
    known = {one.name: block[one.name] for one in fields(ResultConditions) if block.get(one.name) is not None}
    for name in ("motions", "assumptions", "left_out"):
        known[name] = _words(block.get(name), f"{source}: conditions.{name}")
    known["aborted"] = str(data.get("aborted") or "")
    return ResultConditions(**known)


def _motion(name: str, body: object, source: str) -> MotionResult:
    path = f"{source}: motions.{name}"
    if not isinstance(body, Mapping):
        raise HindraxError(f"{path}: found {body!r}, wanted a mapping of coefficients")
    numbers = {key: _number(body[key], f"{path}.{key}") for key in KNOWN if body.get(key) is not None}
    speeds = body.get("speeds") or (0.0, 0.0)
    if not isinstance(speeds, list | tuple) or len(speeds) != 2:
        raise HindraxError(f"{path}.speeds: found {speeds!r}, wanted the lowest and the highest speed")
    low, high = (_finite(speed, f"{path}.speeds") for speed in speeds)
    sentences, codes = (_words(body.get(key), f"{path}.{key}") for key in ("reasons", "reason_codes"))
    names = _words(body.get("names"), f"{path}.names")
    keys = ("covariance", "covariance_calibrated", "covariance_corrected")
    noise, calibrated, corrected = (_matrix(body.get(key), len(names), f"{path}.{key}") for key in keys)
    return MotionResult(
        name,
        "",
        numbers,
        bool(body.get("identifiable", True)),
        read_back(sentences, codes),
        (low, high),
        names,
        covariance=noise,
        covariance_calibrated=calibrated,
        covariance_corrected=corrected,
        budget=_budget(body.get("budget"), f"{path}.budget"),
        quality=_quality(body.get("quality"), f"{path}.quality"),
    )


def _quality(found: object, path: str) -> Mapping[str, float]:
    """Numbers behind a fit, such as its delays; none in files of earlier versions."""
    if found is None:
        return {}
    if not isinstance(found, Mapping):
        raise HindraxError(f"{path}: found {type(found).__name__}, wanted numbers by name")
    return {str(key): _float(value, f"{path}.{key}") for key, value in found.items() if value is not None}


def _matrix(found: object, size: int, path: str) -> Array:
    """Square matrix with a row per name, or none where the file has none."""
    if found is None or found == []:
        return array(np.zeros((0, 0)))
    rows = found if isinstance(found, list) else []
    if len(rows) != size or not all(isinstance(row, list) and len(row) == size for row in rows):
        raise HindraxError(f"{path}: found {len(rows)} rows, wanted {size} by {size} numbers, a row for each of names")
    return array([[_finite(value, path) for value in row] for row in rows])


def _budget(found: object, path: str) -> Mapping[str, Sequence[Contribution]]:
    """Rows of the budget of each coefficient; their remedies are not in the file."""
    if found is None:
        return {}
    if not isinstance(found, Mapping) or not all(isinstance(rows, Mapping) for rows in found.values()):
        raise HindraxError(
            f"{path}: found {type(found).__name__}, wanted influences and their deviations by coefficient"
        )
    return {
        str(key): tuple(Contribution(str(row), _float(std, f"{path}.{key}.{row}"), "") for row, std in rows.items())
        for key, rows in found.items()
    }


def _words(found: object, path: str) -> tuple[str, ...]:
    """Names or sentences of a list, which may be missing or empty."""
    if not isinstance(found, list | tuple | None):
        raise HindraxError(f"{path}: found {found!r}, wanted a list")
    return tuple(map(str, found or ()))


def _number(body: object, path: str) -> Number:
    if not isinstance(body, Mapping):
        raise HindraxError(f"{path}: found {body!r}, wanted a mapping with value and std")
    value, truth = _finite(body.get("value"), f"{path}.value"), body.get("truth")
    std, calibrated = (_float(body.get(name, math.nan), f"{path}.{name}") for name in ("std", "std_calibrated"))
    true = None if truth is None else _finite(truth, f"{path}.truth")
    return Number(value, std, calibrated, true, str(body.get("unit", "")), _corrected(body.get("corrected"), path))


def _corrected(body: object, path: str) -> Corrected | None:
    """The corrected value of a coefficient; none in files of earlier versions."""
    if body is None:
        return None
    if not isinstance(body, Mapping):
        raise HindraxError(f"{path}.corrected: found {body!r}, wanted a mapping with value and intervals")
    ends = [_ends(body.get(key), f"{path}.corrected.{key}") for key in ("interval68", "interval95")]
    return Corrected(_finite(body.get("value"), f"{path}.corrected.value"), *ends)


def _ends(found: object, path: str) -> tuple[float, float]:
    if not isinstance(found, list | tuple) or len(found) != 2:
        raise HindraxError(f"{path}: found {found!r}, wanted the lower and the upper end")
    low, high = (_finite(end, path) for end in found)
    return low, high


def _float(value: object, path: str, wanted: str = "a number") -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise HindraxError(f"{path}: found {value!r}, wanted {wanted}")
    return float(value)


def _finite(value: object, path: str) -> float:
    number = _float(value, path, "a finite number")
    if not math.isfinite(number):
        raise HindraxError(f"{path}: found {value!r}, wanted a finite number")
    return number
