"""A vehicle file judged before it flies: what its thrusters serve and how hard, and what looks wrong."""

import math
from collections.abc import Mapping

from hindrax_cli.health_checks import Check
from hindrax_cli.vehicle_plausibility import (
    FORCE,
    hull_remedy,
    inertia_remedy,
    likely_unit,
    mount_outside,
    outside,
    thrust_objection,
    volume_text,
)
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.maneuver.goal import LOOKS, flyable_motions, largest_wrench, servable_motions
from hindrax_core.errors import UsageError
from hindrax_core.sensor_table import Capability, all_sensors
from hindrax_core.vehicle import AXES, WRENCH_UNITS, Vehicle, capabilities

NEEDED: Mapping[Capability, str] = {
    "rates": "attitude and rates",
    "depth": "depth",
    "velocity": "surge and sway velocity",
}
TURNS = (0.5 * math.pi, math.pi)
"""A quarter and half a turn: what sensors are mounted by, here as a number of radians."""
FLOATS_AT_MOST = 0.1
"""Net buoyancy over weight beyond which trim is implausible."""
POSITIONS = "check unit and origin of position_m"
LEAST_rad, TENTH = 0.5, 0.1
"""From the first up to a turn in radians, and no multiple of the second: an angle that nobody measured in degrees."""
RIGHTING_MARGIN = 0.8
"""Speed limit over the speed up to which a vehicle rights itself."""
ARROWS = "\u2191\u2197\u2192\u2198\u2193\u2199\u2190\u2196"
UP, DOWN = "\u2299", "\u2297"
PICTURE_COLUMNS, PICTURE_LINES = 45, 9
"""Of the picture [characters, lines]: poses and forces fit below it on a screen of 24 lines."""


def findings(vehicle: Vehicle) -> list[Check]:
    """Every check of a valid file."""
    return [*_body(vehicle), *_thrusters(vehicle), *_sensors(vehicle), _truth(vehicle)]


def upright_speed_mps(vehicle: Vehicle) -> float:
    """Speed ahead beyond which a vehicle that cannot control pitch no longer rights itself.

    The moment of a pitched hull grows with (Z_w' - X_u') u^2 (Fossen 2011, section 6.3: Munk), its righting moment
    does not.

    Parameters
    ----------
    vehicle
        With hydrodynamics; without, nothing is known.

    Returns
    -------
    float
        [m/s]; infinite where it rights itself at any speed.
    """
    truth, flown = vehicle.hydrodynamics, servable_motions(AXES, vehicle).flown
    if truth is None or "pitch" in flown or truth.added_mass[2] <= truth.added_mass[0]:
        return math.inf
    righting_Nm = vehicle.weight_N * max(0.0, vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2])
    return math.sqrt(righting_Nm / (truth.added_mass[2] - truth.added_mass[0]))


def _body(vehicle: Vehicle) -> list[Check]:
    net_N, weight_N = vehicle.net_buoyancy_N, vehicle.weight_N
    remedy = "" if abs(net_N) <= FLOATS_AT_MOST * weight_N else "weigh it again, dry and under water"
    arm_m = vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2]
    upright = "" if arm_m > 0.0 else "put center_of_buoyancy_m above center_of_mass_m: z is down"
    centers = ("center_of_mass_m", "center_of_buoyancy_m")
    far = [name for name in centers if outside(getattr(vehicle, name), vehicle.envelope_m)]
    upright = f"outside of the envelope: check unit and origin of {' and '.join(far)}" if far else upright
    inertia = "{:.3g} {:.3g} {:.3g} kg m^2".format(*vehicle.inertia)
    filled = vehicle.volume_m3 / math.prod(vehicle.envelope_m)
    displaced = f"{volume_text(vehicle.volume_m3)} displaced, {filled:.2g} of its box"
    return [
        Check("hull", displaced, hull_remedy(vehicle)),
        Check("net buoyancy", f"{net_N:+.2f} N, {'floats' if net_N > 0.0 else 'sinks'}", remedy),
        Check("righting arm", f"{1e3 * arm_m:.0f} mm", upright),
        Check("inertia", inertia, inertia_remedy(vehicle)),
    ]


def _thrusters(vehicle: Vehicle) -> list[Check]:
    if not vehicle.thrusters:
        return [Check("thrusters", "none", "add thrusters and curves to fly; identification does without")]
    motions = flyable_motions(AXES, vehicle)
    found = [
        Check("flies", ", ".join(motions.flown) or "nothing", "" if motions.flown else "check positions and angles"),
        *(Check("does not fly", f"{motion}: {reason}") for motion, reason in motions.left_out),
    ]
    found.append(Check("channels", ", ".join(str(one.channel) for one in vehicle.thrusters), _shared(vehicle)))
    far = [one.name for one in vehicle.thrusters if outside(one.position_m, vehicle.envelope_m)]
    where = f"{', '.join(far)} far outside of it" if far else "within the envelope"
    found.append(Check("thruster positions", where, POSITIONS if far else ""))
    found += [Check("one position", text, "measure position_m of each") for text in same_positions(vehicle)]
    for name in ("azimuth_deg", "elevation_deg"):
        angles = [abs(getattr(one, name)) for one in vehicle.thrusters]
        fine = (angle for angle in angles if not math.isclose(angle, TENTH * round(angle / TENTH), abs_tol=1e-9))
        if max(angles) <= math.tau and max(fine, default=0.0) >= LEAST_rad:
            found.append(Check(name, f"up to {max(angles):g} deg", f"check the unit of {name}: likely radians"))
    found.append(_hardest(vehicle))
    reach = largest_wrench(vehicle)
    reach_N, need_N = reach["heave"], abs(vehicle.net_buoyancy_N)
    weak = "" if reach_N > 2.0 * need_N else "trim it: the vertical thrusters have too little reserve"
    found.append(Check("heave", f"{reach_N:.1f} N against {need_N:.1f} N of net buoyancy", weak))
    limits = zip(AXES, vehicle.limits.wrench, WRENCH_UNITS, strict=True)
    capped = [f"{axis} {most:g} of {reach[axis]:.0f} {unit}" for axis, most, unit in limits if most < reach[axis]]
    if capped:
        found.append(Check("limits.wrench", f"leaves {', '.join(capped)}"))
    if math.isfinite(upright := upright_speed_mps(vehicle)):
        most = vehicle.limits.speed_mps
        slower = (
            f"set limits.speed_mps to {RIGHTING_MARGIN * upright:.2f}, or ballast it deeper" if most > upright else ""
        )
        found.append(Check("pitch", f"rights itself up to {upright:.2f} m/s ahead, limit {most:g} m/s", slower))
    assumed = [name for name, curve in vehicle.curves.items() if curve.table is None and curve.positive is None]
    found += [Check(f"curve {name}", "positive branch assumed to mirror the negative one") for name in assumed]
    return found


def _hardest(vehicle: Vehicle) -> Check:
    """The strongest thruster against the weight: a curve in grams or kilograms of force is found here."""
    most_N = max(max(map(abs, curve.range_N)) for curve in thrust_curves(vehicle))
    wrong = thrust_objection(most_N, vehicle.weight_N)
    meant = likely_unit([most_N], FORCE, lambda one: not thrust_objection(one[0], vehicle.weight_N))
    remedy = f"check the unit of curves{f': likely {meant}' if meant else ''}" if wrong else ""
    return Check("thrust", f"up to {most_N:.3g} N of a thruster, {most_N / vehicle.weight_N:.2g} of the weight", remedy)


def same_positions(vehicle: Vehicle) -> list[str]:
    """A sentence for each position that several thrusters have: no two are at one, so it was not measured yet."""
    places: dict[tuple[float, float, float], list[str]] = {}
    for one in vehicle.thrusters:
        places.setdefault(one.position_m, []).append(one.name)
    return [
        f"{', '.join(names)} are all at ({', '.join(f'{at:g}' for at in position)}) m"
        for position, names in places.items()
        if len(names) > 1
    ]


def _shared(vehicle: Vehicle) -> str:
    try:
        vehicle.output_channels()
    except UsageError as error:
        return str(error).removeprefix(f"{vehicle.name}: ")
    return ""


def _without_dvl(vehicle: Vehicle) -> str:
    """What shows surge and sway where nothing measures a velocity: the range to a wall, in flight a pose."""
    seen = {motion: vehicle.measuring(looks)[:1] for motion, looks in LOOKS.items()}
    by_wall = [f"{motion} by the range of {name}" for motion, names in seen.items() for name in names]
    blind = [motion for motion, names in seen.items() if not names]
    rest = f"{' and '.join(blind)} {'is' if len(blind) == 1 else 'are'} neither flown nor identified" if blind else ""
    return f"none: {'; '.join(one for one in (' and '.join(by_wall), rest) if one)}"


def _sensors(vehicle: Vehicle) -> list[Check]:
    far = [name for name, one in vehicle.sensors.items() if mount_outside(one.position_m, vehicle.envelope_m)]
    found = [Check("sensor positions", f"{', '.join(far)} far outside of the envelope", POSITIONS)] if far else []
    for name, mount in vehicle.sensors.items():
        if any(math.isclose(abs(angle), turn, rel_tol=0.01) for angle in mount.rotation_deg for turn in TURNS):
            turned = f"turned by {' '.join(f'{angle:g}' for angle in mount.rotation_deg)} deg"
            found.append(Check(f"rotation of {name}", turned, "check the unit of rotation_deg: likely radians"))
    for name, mount in vehicle.sensors.items():
        measures = ", ".join(one.replace("_", " ") for one in capabilities(mount))
        port = mount.port or ("on the output's line" if name in vehicle.on_output_line else "no port")
        found.append(Check(name, f"{measures}; {port}"))
    for capability, what in NEEDED.items():
        names = vehicle.measuring(capability)
        if not names and capability == "velocity" and vehicle.sensors:
            found.append(Check(capability, _without_dvl(vehicle)))
        elif not names:
            known = " or ".join(row.name for row in all_sensors() if capability in row.measures)
            found.append(Check(capability, "missing", f"add {known} to sensors: nothing measures {what}"))
    return found


def _truth(vehicle: Vehicle) -> Check:
    if vehicle.hydrodynamics is not None:
        return Check("hydrodynamics", "given: the mock can fly")
    return Check("hydrodynamics", "missing", "the mock needs it: `./hindrax estimate --vehicle FILE` prints the block")


def picture(vehicle: Vehicle) -> str:
    """Top view of the thrusters, bow up: an arrow along positive thrust, a dot for up, a cross for down."""
    ahead = max([0.5 * vehicle.envelope_m[0], *(abs(one.position_m[0]) for one in vehicle.thrusters)])
    across = max([0.5 * vehicle.envelope_m[1], *(abs(one.position_m[1]) for one in vehicle.thrusters)])
    canvas = [[" "] * PICTURE_COLUMNS for _ in range(PICTURE_LINES)]

    def place(x_m: float, y_m: float) -> tuple[int, int]:
        line = round((1.0 - x_m / ahead) * 0.5 * (PICTURE_LINES - 3)) + 1
        return line, round((1.0 + y_m / across) * 0.5 * (PICTURE_COLUMNS - 9)) + 4

    (top, left), (bottom, right) = (
        place(s * 0.5 * vehicle.envelope_m[0], -s * 0.5 * vehicle.envelope_m[1]) for s in (1, -1)
    )
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            edge = (row in (top, bottom), column in (left, right))
            canvas[row][column] = {(True, True): "+", (True, False): "-", (False, True): "|"}.get(edge, " ")
    taken: set[tuple[int, int]] = set()
    for one in vehicle.thrusters:
        row, column = place(*one.position_m[:2])
        label = f"{one.name}{_arrow(one.azimuth_deg, one.elevation_deg)}"[:PICTURE_COLUMNS]
        start = min(max(0, column - len(label) // 2), PICTURE_COLUMNS - len(label))
        cells = {at: {(at, start + shift) for shift in range(len(label))} for at in range(PICTURE_LINES)}
        # One above the other: the nearest row with room, or none, where a column is full of them.
        free = [at for at in sorted(cells, key=lambda at: abs(at - row)) if not cells[at] & taken]
        for at in free[:1]:
            taken |= cells[at]
            canvas[at][start : start + len(label)] = label
    lines = ["bow".center(PICTURE_COLUMNS), *("".join(row) for row in canvas)]
    return "\n".join(line.rstrip() for line in lines).rstrip()


def _arrow(azimuth_deg: float, elevation_deg: float) -> str:
    if abs(elevation_deg) > 45.0:  # more up than along
        return UP if math.sin(math.radians(elevation_deg)) > 0.0 else DOWN
    return ARROWS[round(azimuth_deg / 45.0) % 8]
