"""Records of vehicles whose water is not ours: ellipsoids in the fluid of MuJoCo.

The fluid has drag that depends on the whole velocity, lift, Magnus and Munk terms, and added mass with off-diagonal
terms, because the ellipsoids are off the center (MuJoCo, chapter Computation, Fluid forces). Eight propellers behind a
lag lose thrust to the water that moves along, T = T_0 - T_nu |n| u (Fossen 2011 eq. 9.8). The record has the wrench
of the commands at rest, as a stack knows it. Simulation needs the wheel `mujoco`; a record that was written does not.

Symbols: nu velocity (6,) and SNAME axes about the center of mass; R body to level axes, its last row "down" in the
body; B (6, 8) wrench per newton of the thrusters, pinv(B) how a wrench is shared out; M body and added mass (6, 6).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hindrax_analysis.records.recording import Recording
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.tuning import Tuning

STEP_S, COMMAND_S, RATES_S, DOPPLER_S, AXIS_S = 0.005, 0.04, 0.04, 0.12, 20.0
DENSITY_kgpm3, VISCOSITY_Pas, GRAVITY_mps2 = 1000.0, 9e-4, 9.81
DOPPLER_mps, GYRO_radps, DEPTH_m, ANGLE_rad = 0.006, 0.003, 0.003, 0.003
THRUST_NOISE, NOISE_S = 0.03, 0.1
LEVEL, TILTING = 0.4, 0.4
"""Largest command of a maneuver, of the most that the axis has, and of the moment that keeps it upright."""
SHARES = (0.4, 0.7, 1.0)
"""Speeds at which the drag is compared, of the highest in the record."""
MOST_SIGMAS = 3.0
AS_THE_COMMAND = Tuning(wrench_gain_sigma=0.1)
KINDS = ("steps", "chirps", "pilot", "whirl")


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """Part of a hull: half axes and center about the center of mass [m], coefficients of blunt and slender drag [-]."""

    half_m: tuple[float, float, float]
    center_m: tuple[float, float, float]
    blunt: float
    slender: float


@dataclass(frozen=True, slots=True)
class Plant:
    """A vehicle in MuJoCo's fluid: SNAME axes about its center of mass.

    `lever_m`: thrusters from the center, fore and aft, and to each side; `lost`: share of the thrust lost at 10 N and
    0.5 m/s along a propeller; `lag_s`: of the thrust.
    """

    name: str
    mass_kg: float
    inertia_kgm2: tuple[float, float, float]
    volume_m3: float
    buoyant_at_m: float
    hull: tuple[Ellipsoid, ...]
    lever_m: tuple[float, float]
    strongest_N: float
    lag_s: float
    lost: float

    @property
    def vehicle(self) -> Vehicle:
        """What a team knows of it: no thrusters."""
        low, high = (
            np.array([[c + side * h for h, c in zip(one.half_m, one.center_m, strict=True)] for one in self.hull])
            for side in (-1.0, 1.0)
        )
        length, width, height = (high.max(axis=0) - low.min(axis=0)).tolist()
        return Vehicle(
            name=self.name,
            mass_kg=self.mass_kg,
            volume_m3=self.volume_m3,
            envelope_m=(length, width, height),
            inertia_kgm2=self.inertia_kgm2,
            center_of_buoyancy_m=(0.0, 0.0, self.buoyant_at_m),
        )

    @property
    def directions(self) -> Array:
        """Wrench per newton of the eight thrusters: (6, 8) [-, m]. Four at 45 degrees, four vertical.

        The flat ones push forward, those at the bow inward and those at the stern outward: so all four serve surge,
        sway and yaw. A column is [d; p x d], direction and moment about the center of mass.
        """
        x, y = self.lever_m
        corners = [(x, y), (x, -y), (-x, y), (-x, -y)]
        c = math.sqrt(0.5)
        flat = [((a, b, 0.02), (c, -c * math.copysign(1.0, a * b), 0.0)) for a, b in corners]
        upright = [((0.7 * a, b, -0.05), (0.0, 0.0, 1.0)) for a, b in corners]
        return np.array([[*d, *np.cross(p, d)] for p, d in (*flat, *upright)]).T


PLANTS = (
    Plant(
        "small", 11.5, (0.20, 0.24, 0.26), 0.01165, -0.02,
        (
            Ellipsoid((0.20, 0.12, 0.09), (0.0, 0.0, -0.04), 1.1, 0.5),
            Ellipsoid((0.19, 0.035, 0.05), (0.01, 0.15, 0.06), 0.9, 0.4),
            Ellipsoid((0.19, 0.035, 0.05), (0.01, -0.15, 0.06), 0.9, 0.4),
        ),
        (0.15, 0.13), 35.0, 0.12, 0.15,
    ),
    Plant(
        "middle", 22.0, (0.55, 0.75, 0.9), 0.02215, -0.03,
        (
            Ellipsoid((0.28, 0.22, 0.10), (-0.02, 0.0, -0.07), 1.0, 0.7),
            Ellipsoid((0.22, 0.20, 0.09), (0.04, 0.0, 0.09), 1.3, 0.4),
        ),
        (0.22, 0.20), 45.0, 0.07, 0.10,
    ),
    Plant(
        "slender", 45.0, (0.9, 4.2, 4.3), 0.0452, -0.04,
        (
            Ellipsoid((0.60, 0.16, 0.15), (0.0, 0.0, 0.0), 1.0, 0.3),
            Ellipsoid((0.12, 0.02, 0.14), (-0.45, 0.0, -0.15), 1.2, 0.3),
        ),
        (0.40, 0.16), 60.0, 0.20, 0.12,
    ),
)  # fmt: skip


# ---- the fluid


class Fluid:
    """Force of the water on a hull that moves, and its added mass; evaluated by MuJoCo."""

    def __init__(self, plant: Plant) -> None:
        """UsageError without the wheel."""
        try:
            import mujoco  # noqa: PLC0415  # only for a simulation; a written record is read without it
        except ImportError as error:
            raise UsageError(
                'needs the package `mujoco`, which is not installed here; pip install "hindrax[benchmark]"'
            ) from error
        self._mujoco = mujoco
        geoms = "".join(
            f'<geom type="ellipsoid" size="{_text(one.half_m)}" pos="{_text(one.center_m)}" mass="0" '
            f'fluidshape="ellipsoid" fluidcoef="{one.blunt} {one.slender} 1.5 1 1"/>'
            for one in plant.hull
        )
        self._model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option density="{DENSITY_kgpm3}" viscosity="{VISCOSITY_Pas}" gravity="0 0 0"/><worldbody><body>'
            f'<freejoint/><inertial pos="0 0 0" mass="{plant.mass_kg}" diaginertia="{_text(plant.inertia_kgm2)}"/>'
            f"{geoms}</body></worldbody></mujoco>"
        )
        self._data = mujoco.MjData(self._model)
        # Without turning it: what the water does depends on the velocity in body axes alone.
        mujoco.mj_fwdPosition(self._model, self._data)

    def force(self, nu: Array) -> Array:
        """Drag, lift and the Coriolis force of the entrained water: (6,) [N, N m]."""
        mujoco, model, data = self._mujoco, self._model, self._data
        data.qvel[:] = nu
        mujoco.mj_comVel(model, data)
        mujoco.mj_passive(model, data)
        return array(data.qfrc_fluid.copy())

    @property
    def added_mass(self) -> Array:
        """That of all ellipsoids about the center of mass: (6, 6), which MuJoCo leaves to the inertia of the body.

        Each is diagonal at its own center c. There the velocity is v + omega x c, so nu_c = H nu with H = [1, -c x;
        0, 1], and equal energy gives H' M_c H: off the center, pushing also turns.
        """
        total = np.zeros((6, 6))
        for row, center in zip(self._model.geom_fluid, self._model.geom_pos, strict=True):
            moved = np.eye(6)
            moved[:3, 3:] = -_cross(center)
            total += moved.T @ np.diag(DENSITY_kgpm3 * row[6:12]) @ moved
        return total


def _text(values: Sequence[float]) -> str:
    return " ".join(map(str, values))


def _cross(p: Array) -> Array:
    """Matrix of the cross product: (3, 3)."""
    x, y, z = p
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


# ---- a flight


@dataclass(frozen=True, slots=True)
class ForeignRecord:
    """A record, its vehicle and its truth: drag (6, 3) [N, N m] at speeds (6, 3) along each axis alone, added mass."""

    name: str
    vehicle: Vehicle
    recording: Recording
    speeds: Array
    drag: Array
    added_mass: Array


Helmsman = Callable[[float], Array]
"""Wanted shares of the strongest wrench at a time, (6,); NaN of an axis that is held."""


def helmsman(kind: str, rng: np.random.Generator) -> tuple[Helmsman, float]:
    """What is flown, and for how long [s]."""
    if kind in ("pilot", "whirl"):
        return (_pilot(rng) if kind == "pilot" else _whirl(rng)), 120.0
    levels = rng.uniform(0.25, 1.0, (6, 8)) * np.where(np.arange(8) % 2, -1.0, 1.0)
    rates = rng.uniform(0.8, 1.2, 6)

    def wanted(t: float) -> Array:
        """Wrench at a time, (6,) [N, N m]; NaN where the axis is held."""
        out = np.full(6, np.nan)
        axis, since = int(t // AXIS_S), t % AXIS_S
        if axis < 6:
            chirp = math.sin(math.tau * rates[axis] * (0.06 * since + 0.006 * since**2))
            out[axis] = chirp if kind == "chirps" else levels[axis, int(since // 2.5)]
        return out

    return wanted, 6 * AXIS_S


def _pilot(rng: np.random.Generator) -> Helmsman:
    """Sticks of surge, sway, heave and yaw, each pushed for a few seconds, about half of the time."""
    sticks = {}
    for axis in (0, 1, 2, 5):
        ends = np.cumsum(rng.uniform(0.8, 4.0, 200))
        sticks[axis] = ends, np.where(rng.random(200) < 0.5, rng.uniform(-1.0, 1.0, 200), np.nan)

    def wanted(t: float) -> Array:
        """Wrench at a time, (6,) [N, N m]; NaN where the axis is held."""
        out = np.full(6, np.nan)
        for axis, (ends, pushes) in sticks.items():
            out[axis] = pushes[np.searchsorted(ends, t)]
        return out

    return wanted


def _whirl(rng: np.random.Generator) -> Helmsman:
    """All axes at once, each with two sines of its own."""
    rates, phases = rng.uniform(0.05, 0.35, (6, 2)), rng.uniform(0.0, math.tau, (6, 2))
    return lambda t: array(0.5 * np.sin(math.tau * rates * t + phases).sum(axis=1))


@dataclass(slots=True)
class _Motion:
    """Velocity (6,), rotation to level axes (3, 3), depth [m]."""

    nu: Array
    R: Array
    depth_m: float = 0.0

    @property
    def roll_pitch(self) -> tuple[float, float]:
        return math.atan2(self.R[2, 1], self.R[2, 2]), -math.asin(max(-1.0, min(1.0, self.R[2, 0])))


def fly(plant: Plant, kind: str, seed: int) -> ForeignRecord:
    """Simulate a flight: what is not pushed is held by damping, depth and heading by their errors too.

    Three clocks run: commands (COMMAND_S), rates with angles and depth (RATES_S), and the DVL (DOPPLER_S, else NaN),
    each with the noise of its instrument. Between them the water moves the vehicle in steps of STEP_S. Moments of roll
    and pitch stay below what rights the vehicle. The thrust follows its command with a first-order lag, exact over a
    step; on it is a relative noise with memory (Ornstein-Uhlenbeck with NOISE_S and the deviation THRUST_NOISE: its
    increments have the variance 2 sigma^2 dt / tau), as of propellers in turbulence. The truth about the drag is the
    force of the fluid along each axis alone, at shares of the speed that the record reached.

    Parameters
    ----------
    plant
        Vehicle and water of another kind.
    kind
        How it is flown.
    seed
        Of what is random in it.

    Returns
    -------
    ForeignRecord
        Velocities and wrenches, as a team would have recorded them.
    """
    rng, fluid = np.random.default_rng(seed), Fluid(plant)
    wanted, lasts_s = helmsman(kind, rng)
    B = plant.directions
    share_out = np.linalg.pinv(B)
    strongest = plant.strongest_N / np.abs(share_out).max(axis=0)
    largest = LEVEL * strongest
    largest[5] *= 0.5
    upright_Nm = -DENSITY_kgpm3 * GRAVITY_mps2 * plant.volume_m3 * plant.buoyant_at_m
    largest[3:5] = np.minimum(largest[3:5], TILTING * upright_Nm)
    M = fluid.added_mass + np.diag([*[plant.mass_kg] * 3, *plant.inertia_kgm2])
    inverse = np.linalg.inv(M)
    now, thrust, noise, held_m, heading = _Motion(np.zeros(6), np.eye(3)), np.zeros(8), np.zeros(8), 0.0, 0.0
    commands = np.zeros(8)
    rows: dict[str, list[tuple[float, ...]]] = {"wrench": [], "velocity": [], "attitude": []}
    commanded, rated, doppler = (round(span / STEP_S) for span in (COMMAND_S, RATES_S, DOPPLER_S))
    for step in range(round(lasts_s / STEP_S)):
        t = step * STEP_S
        if step % commanded == 0:
            pushed = largest * wanted(t)
            heading += now.nu[5] * COMMAND_S
            if math.isfinite(pushed[2]):
                held_m = now.depth_m
            if math.isfinite(pushed[5]):
                heading = 0.0
            holding = -strongest * np.array([0.3, 0.3, 0.3, 0.4, 0.4, 0.4]) * now.nu
            holding[2] += strongest[2] * 0.4 * (held_m - now.depth_m) + (plant.volume_m3 - plant.mass_kg / 1e3) * 9810.0
            holding[5] -= strongest[5] * 0.4 * heading
            commands = np.clip(share_out @ np.where(np.isfinite(pushed), pushed, holding), *_limits(plant))
            rows["wrench"].append((t, *(B @ commands)))
        if step % rated == 0:
            has_doppler = step % doppler == 0
            linear = now.nu[:3] + DOPPLER_mps * rng.standard_normal(3) if has_doppler else np.full(3, np.nan)
            rows["velocity"].append((t, *linear, *(now.nu[3:] + GYRO_radps * rng.standard_normal(3))))
            angles = np.array(now.roll_pitch) + ANGLE_rad * rng.standard_normal(2)
            rows["attitude"].append((t, *angles, now.depth_m + DEPTH_m * rng.standard_normal()))
        thrust += (commands - thrust) * (1.0 - math.exp(-STEP_S / plant.lag_s))
        noise += -noise * STEP_S / NOISE_S + THRUST_NOISE * math.sqrt(2.0 * STEP_S / NOISE_S) * rng.standard_normal(8)
        _move(now, plant, fluid, inverse, thrust * (1.0 + noise))
    tables = {key: array(np.array(found)) for key, found in rows.items()}
    recording = recorded(
        f"{plant.name}-{kind}-{seed}",
        {name: part for key, rows in tables.items() for name, part in ((f"{key}_t", rows[:, 0]), (key, rows[:, 1:]))},
    )
    top = np.nanpercentile(np.abs(recording.velocity), 98.0, axis=0)
    speeds = np.outer(top, SHARES)
    drag = [[-fluid.force(speed * np.eye(6)[axis])[axis] for speed in speeds[axis]] for axis in range(6)]
    return ForeignRecord(
        recording.source, plant.vehicle, recording, speeds, np.array(drag), np.diag(fluid.added_mass).copy()
    )


def _limits(plant: Plant) -> tuple[float, float]:
    """Least and largest force of a thruster [N]."""
    return -plant.strongest_N, plant.strongest_N


def _move(now: _Motion, plant: Plant, fluid: Fluid, inverse: Array, thrust: Array) -> None:
    """One step of M nu' = fluid + B T + weight - omega x momentum, by the midpoint rule.

    The rotation is that of the middle rates, to second order, and is made orthogonal again by QR, whose signs are those
    of the rotation before.
    """
    B = plant.directions

    def acceleration(nu: Array) -> Array:
        """Acceleration at a velocity, (6,) [m/s^2, rad/s^2]: of thrust less what inflow takes, and of own momenta.

        `along` is the speed of the water along each propeller, `lost` T_nu |n| u with |n| as the root of the thrust,
        scaled to the share `plant.lost` at 10 N and 0.5 m/s. Momenta of the entrained water are in the fluid's force.
        """
        along = B[:3].T @ nu[:3] + B[3:].T @ nu[3:]
        lost = plant.lost * math.sqrt(10.0) / 0.5 * np.sqrt(np.abs(thrust)) * along
        down = now.R[2]
        weight_N, lift_N = plant.mass_kg * GRAVITY_mps2, DENSITY_kgpm3 * GRAVITY_mps2 * plant.volume_m3
        by_weight = np.concatenate(
            [(weight_N - lift_N) * down, np.cross([0.0, 0.0, plant.buoyant_at_m], -lift_N * down)]
        )
        turning, momentum = nu[3:], np.concatenate([plant.mass_kg * nu[:3], np.array(plant.inertia_kgm2) * nu[3:]])
        own = np.concatenate([np.cross(turning, momentum[:3]), np.cross(turning, momentum[3:])])
        return array(inverse @ (fluid.force(nu) + B @ (thrust - lost) + by_weight - own))

    middle = now.nu + 0.5 * STEP_S * acceleration(now.nu)
    now.nu = now.nu + STEP_S * acceleration(middle)
    now.depth_m += STEP_S * float(now.R[2] @ middle[:3])
    turn = STEP_S * _cross(middle[3:])
    turned = now.R @ (np.eye(3) + turn + 0.5 * turn @ turn)
    now.R, _ = np.linalg.qr(turned)
    now.R = array(now.R * np.sign(np.sum(now.R * turned, axis=0)))


# ---- files


def write(record: ForeignRecord, folder: Path) -> None:
    """One compressed file of a record and its truth, rounded to what its instruments resolve."""
    r = record.recording
    np.savez_compressed(
        folder / f"{record.name}.npz",
        velocity_t=r.velocity_t, velocity=np.round(r.velocity, 4).astype(np.float32),
        wrench_t=r.wrench_t, wrench=np.round(r.wrench, 3).astype(np.float32),
        attitude_t=r.attitude_t, attitude=np.round(r.attitude, 4).astype(np.float32),
        speeds=record.speeds, drag=record.drag, added_mass=record.added_mass,
    )  # fmt: skip


def recorded(name: str, tables: Mapping[str, Array]) -> Recording:
    """Record of its tables by name."""
    keys = ("velocity_t", "velocity", "wrench_t", "wrench", "attitude_t", "attitude")
    v_t, v, w_t, w, a_t, a = (tables[key] for key in keys)
    return Recording(name, v_t, v, w_t, w, a_t, a)


def read(file: Path) -> ForeignRecord:
    """A record that was written; its vehicle is the plant of its name."""
    with np.load(file) as found:
        tables = {key: array(found[key]) for key in found.files}
    truth = [tables.pop(key) for key in ("speeds", "drag", "added_mass")]
    plant = next(one for one in PLANTS if file.stem.startswith(one.name))
    return ForeignRecord(file.stem, plant.vehicle, recorded(file.stem, tables), *truth)
