"""Whether the numbers of a vehicle agree with each other, and which unit was likely meant where they do not.

Bounds are wide: no vehicle from a hand-held ROV to one of the work class lies outside, and a wrong unit does.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3
from hindrax_core.text.coded import Coded, coded
from hindrax_core.vehicle import Vehicle

Units = Sequence[tuple[str, float]]
"""Names of units that are mistaken for ours, each with what one of them is in ours."""
MASS: Units = (("grams", 1e-3),)
VOLUME: Units = (("litres", 1e-3), ("cubic centimeters", 1e-6))
LENGTH: Units = (("centimeters", 1e-2), ("millimeters", 1e-3), ("inches", 0.0254))
FORCE: Units = (("grams of force", 1e-3 * GRAVITY_mps2), ("kilograms of force", GRAVITY_mps2))
INERTIA: Units = (("g m^2", 1e-3), ("kg cm^2", 1e-4), ("kg mm^2", 1e-6))
ANGLE: Units = (("radians", math.degrees(1.0)),)
EMPTIEST = 0.02
"""Volume of a hull over that of its box: 0.14 for the Hindrax, 0.3 for a BlueROV2, 1 for a box."""
SLIMMEST = 20.0
"""Longest side of a hull over its shortest: 9 for a torpedo-shaped AUV."""
OUTSIDE = 1.5
"""Position over half the envelope beyond which unit or origin is implausible."""
INERTIA_BOUNDS = (0.05, 6.0)
"""Moment of inertia over that of a homogeneous prism: 3 with all mass in the corners of its box, more with water."""
PULL_AT_MOST = 0.5
"""Net buoyancy over weight beyond which it is not that of a vehicle which thrusters hold."""
THRUST = (0.01, 5.0)
"""Thrust of one thruster over the weight of the vehicle: 0.1 for the Hindrax, 0.3 for a BlueROV2 with T200."""


class Implausible(StrEnum):
    """Why numbers of a vehicle cannot be; `NONE` where they can."""

    NONE = ""
    NUMBERS = "numbers"
    """Too few, too many, none, or one out of its bounds."""
    LAYOUT = "layout"
    ENDED = "ended"
    SLIM = "slim"
    OVERFULL = "overfull"
    EMPTY = "empty"
    PULL = "pull"
    THRUST = "thrust"
    OUTSIDE = "outside"
    POOL = "pool"


SENTENCES: Mapping[Implausible, str] = {
    Implausible.NONE: "",
    Implausible.NUMBERS: "wanted {count} number{s} from {ranges}{hint}",
    Implausible.LAYOUT: "wanted one of {known}",
    Implausible.ENDED: "found nothing, the input has ended; wanted an answer to each question",
    Implausible.SLIM: f"one side of its box is more than {SLIMMEST:g} times another: are all in the same unit?",
    Implausible.OVERFULL: "{sizes}: more than it holds",
    Implausible.EMPTY: f"{{sizes}}: less than {EMPTIEST:.0%} of it",
    Implausible.PULL: f"{{pull_N:g}} N for a weight of {{weight_N:.3g}} N: wanted at most {PULL_AT_MOST:.0%} of it",
    Implausible.THRUST: "{thrust_N:.3g} N for a weight of {weight_N:.3g} N: wanted {low:.2g} to {high:.3g} N",
    Implausible.OUTSIDE: "far outside of an envelope of {size} m",
    Implausible.POOL: "too small for a vehicle of {size} m",
}
"""The sentence of each code."""
PLAUSIBLE = coded(SENTENCES, Implausible.NONE)
"""The sentence of numbers that can be: empty."""


def implausible(code: Implausible, **numbers: object) -> Coded[Implausible]:
    """Fill the sentence of a code; `numbers` are its fields."""
    return coded(SENTENCES, code, **numbers)


def hull_objection(volume_m3: float, size_m: Vec3) -> Coded[Implausible]:
    """Why a displaced volume cannot be that of a hull in its box; empty when it can."""
    if max(size_m) > SLIMMEST * min(size_m):
        return implausible(Implausible.SLIM)
    box_m3 = math.prod(size_m)
    sizes = f"{volume_text(volume_m3)} displaced, and a box of {volume_text(box_m3)}"
    if volume_m3 > box_m3:
        return implausible(Implausible.OVERFULL, sizes=sizes)
    return PLAUSIBLE if volume_m3 >= EMPTIEST * box_m3 else implausible(Implausible.EMPTY, sizes=sizes)


def pull_objection(pull_N: float, weight_N: float) -> Coded[Implausible]:
    """Why a net buoyancy cannot be that of a vehicle of this weight; empty when it can."""
    if abs(pull_N) <= PULL_AT_MOST * weight_N:
        return PLAUSIBLE
    return implausible(Implausible.PULL, pull_N=pull_N, weight_N=weight_N)


def thrust_objection(thrust_N: float, weight_N: float) -> Coded[Implausible]:
    """Why one thruster of a vehicle of this weight cannot push so hard; empty when it can."""
    low, high = (fraction * weight_N for fraction in THRUST)
    if low <= thrust_N <= high:
        return PLAUSIBLE
    return implausible(Implausible.THRUST, thrust_N=thrust_N, weight_N=weight_N, low=low, high=high)


def outside(position_m: Sequence[float], size_m: Sequence[float]) -> bool:
    """Whether a position from the center of the envelope is far outside of it."""
    return any(abs(at) > 0.5 * OUTSIDE * size for at, size in zip(position_m, size_m, strict=True))


def inertia_remedy(vehicle: Vehicle) -> str:
    """What to correct where moments of inertia are not those of a body in its box; empty when they are, or are none."""
    if vehicle.inertia_kgm2 is None:
        return ""
    prism = replace(vehicle, inertia_kgm2=None).inertia

    def fits(values: Sequence[float]) -> bool:
        low, high = INERTIA_BOUNDS
        inside = all(low * one <= value <= high * one for value, one in zip(values, prism, strict=True))
        # None is larger than the other two together: they are sums of y^2 + z^2, z^2 + x^2 and x^2 + y^2.
        return inside and 2.0 * max(values) <= 1.05 * sum(values)

    if fits(vehicle.inertia_kgm2):
        return ""
    meant = likely_unit(vehicle.inertia_kgm2, INERTIA, fits)
    usual = " ".join(f"{one:.2g}" for one in prism)
    return f"check inertia_kgm2{f': likely {meant}' if meant else ''}; of a homogeneous box: {usual}"


def mount_outside(position_m: Vec3, size_m: Vec3) -> bool:
    """Whether the position of a sensor is too far away; it may stick out of a flat hull, or ahead of a short one."""
    return outside(position_m, (max(size_m),) * 3)


def likely_unit(values: Sequence[float], units: Units, is_right: Callable[[tuple[float, ...]], bool]) -> str:
    """Find the unit in which values were likely given by mistake.

    Parameters
    ----------
    values
        As found, in our unit.
    units
        That are mistaken for ours.
    is_right
        Whether values in our unit can be.

    Returns
    -------
    str
        The first unit in which they would be right, with them in ours: `centimeters: 0.457 0.338`; empty if none.
    """
    for unit, factor in units:
        converted = tuple(float(f"{factor * one:.4g}") for one in values)
        if is_right(converted):
            return f"{unit}: {' '.join(f'{one:g}' for one in converted)}"
    return ""


def hull_remedy(vehicle: Vehicle) -> str:
    """What to correct where mass, volume and envelope do not fit each other; empty when they do."""
    mass_kg, volume_m3, size_m = vehicle.mass_kg, vehicle.volume_m3, vehicle.envelope_m
    density = vehicle.water.density_kgpm3

    def fits(mass_kg: float, volume_m3: float, size_m: Sequence[float]) -> bool:
        length, width, height = size_m
        pull_N = (volume_m3 * density - mass_kg) * GRAVITY_mps2
        floats = not pull_objection(pull_N, mass_kg * GRAVITY_mps2)
        return floats and not hull_objection(volume_m3, (length, width, height))

    if fits(mass_kg, volume_m3, size_m):
        return ""
    # A volume that was computed from a wrong mass is wrong by as much.
    tried = {
        "mass_kg": likely_unit([mass_kg], MASS, lambda one: fits(one[0], volume_m3, size_m)),
        "volume_m3": likely_unit([volume_m3], VOLUME, lambda one: fits(mass_kg, one[0], size_m)),
        "envelope_m": likely_unit(size_m, LENGTH, lambda size: fits(mass_kg, volume_m3, size)),
        "mass_kg and volume_m3": likely_unit(
            [mass_kg, volume_m3], MASS, lambda both: fits(both[0], both[1], size_m)
        ),
    }  # fmt: skip
    key, meant = next(((key, meant) for key, meant in tried.items() if meant), ("", ""))
    return f"correct {key}, likely in {meant}" if meant else "correct mass_kg, volume_m3 or envelope_m"


def volume_text(volume_m3: float) -> str:
    """Volume with three digits, in litres where it is below a cubic meter."""
    return f"{1e3 * volume_m3:.3g} litres" if volume_m3 < 1.0 else f"{float(f'{volume_m3:.3g}'):.7g} m^3"
