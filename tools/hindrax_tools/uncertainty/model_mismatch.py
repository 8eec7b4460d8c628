"""Records of vehicles that obey laws which no row of the uncertainty budget knows, and what `identify` makes of them.

`python -m hindrax_tools.uncertainty.model_mismatch` prints the table of docs/explanation/third-party-records.md: five
vehicles, twelve laws, surge, heave and yaw flown one after the other. The truth is the drag of the hull alone:
k_q |v| v + k_l v, unless the law is another drag.
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_analysis.records.damage import without_damage
from hindrax_analysis.records.recording import Recording
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import CAUSES
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import rigid_mass
from hindrax_ident.tuning import Tuning

AXES = {"surge": 0, "heave": 2, "yaw": 5}
MOTIONS = ("surge", "heave_down", "heave_up", "yaw")
STEP_S, EVERY, LEG_S, LEVELS = 0.01, 10, 4.0, (1.0, 0.35, 0.7, 0.5)
SHARES, MOST_SIGMAS = (0.25, 0.5, 1.0), 3.0
REST_S = 20.0
"""Between two axes, and before the first."""


@dataclass(frozen=True, slots=True)
class Axis:
    """What moves along one axis: mass and added mass [kg, kg m^2], drag, largest thrust [N, N m], lag [s]."""

    body: float
    added: float
    k_q: float
    k_l: float
    pull: float
    lag_s: float
    held: float
    """Net buoyancy that the helmsman holds against [N]."""

    @property
    def mass(self) -> float:
        """Mass with added mass [kg, kg m^2]."""
        return self.body + self.added

    @property
    def speed(self) -> float:
        """Highest steady speed [m/s, rad/s]."""
        return (math.sqrt(self.k_l**2 + 4.0 * self.k_q * self.pull) - self.k_l) / (2.0 * self.k_q)

    def drag(self, v: float) -> float:
        """Drag of the hull [N, N m]."""
        return self.k_q * abs(v) * v + self.k_l * v


@dataclass(slots=True)
class Now:
    """Where a simulated axis is: time, velocity, position, force of the thrusters, and its past."""

    axis: Axis
    t: float = 0.0
    v: float = 0.0
    s: float = 0.0
    past: float = 0.0
    older: float = 0.0


@dataclass(frozen=True, slots=True)
class Law:
    """One thing that is not as the model has it; each as a function of where the axis is."""

    name: str
    thrust: Callable[[float, Axis], float] = lambda u, _axis: u
    """True steady thrust at a recorded one."""
    drag: Callable[[Axis, float], float] = Axis.drag
    """True drag of the hull at a speed."""
    force: Callable[[Now], float] = lambda _now: 0.0
    """Anything else that pushes."""
    mass: Callable[[Now], float] = lambda now: now.axis.mass
    slew: bool = False
    filtered_s: float = 0.0


def _cubic(axis: Axis, v: float) -> float:
    x = v / axis.speed
    return axis.drag(axis.speed) * (0.25 * x + 0.75 * x**3)


def _crisis(axis: Axis, v: float) -> float:
    """A third of the quadratic drag is lost about 0.6 of the highest speed, as on a sphere."""
    return axis.drag(v) * (1.0 - 0.3 / (1.0 + math.exp(-(abs(v) / axis.speed - 0.6) / 0.05)))


def _history(now: Now) -> float:
    """Two exponentials of 0.3 s and 8 s, near t^-1/2 between them: Basset 1888."""
    return -0.1 * now.axis.mass * ((now.v - now.past) / 0.3 + (now.v - now.older) / 8.0)


def _vortices(now: Now) -> float:
    """A tenth of the drag swings with a Strouhal number of 0.2 on a third of a meter, or of the turn."""
    return 0.2 * now.axis.drag(now.v) * math.sin(math.tau * 0.2 * now.s / 0.3)


LAWS = (
    Law("cubic drag", drag=_cubic),
    Law("drag crisis", drag=_crisis),
    Law("rope on the floor", force=lambda now: -0.04 * now.axis.pull * math.tanh(now.v / (0.02 * now.axis.speed))),
    Law("thrust of another power", lambda u, axis: math.copysign(axis.pull * abs(u / axis.pull) ** 1.2, u)),
    Law("weak reverse", lambda u, _axis: u if u > 0.0 else 0.85 * u),
    Law("thrust that ramps", slew=True),
    Law("vortices", force=_vortices),
    Law("weed caught at half time", force=lambda now: -0.2 * now.axis.drag(now.v) * (now.t > 16.0)),
    Law("near a wall", force=lambda now: -0.3 * now.axis.drag(now.v) * math.exp(-abs(now.s + 1.0) / 0.5),
        mass=lambda now: now.axis.mass * (1.0 + 0.15 * math.exp(-abs(now.s + 1.0) / 0.5))),
    Law("history force", force=_history),
    Law("filtered velocity", filtered_s=0.3),
    Law("swell", force=lambda now: 0.06 * now.axis.pull * math.sin(math.tau * now.t / 6.0)),
)  # fmt: skip


def _vehicle(
    name: str, mass_kg: float, size_m: float, speed_mps: float, buoyancy: float
) -> tuple[Vehicle, dict[str, Axis]]:
    """A vehicle of a mass, length, speed and net buoyancy (share of the weight); coefficients about those of a box."""
    rng = np.random.default_rng(round(10.0 * mass_kg))
    volume_m3 = mass_kg / 1000.0 * (1.0 + buoyancy)
    known = Vehicle(name, mass_kg, volume_m3, (size_m, 0.7 * size_m, 0.6 * size_m))
    axes = {}
    for axis, at in AXES.items():
        turns = at >= 3
        usual, top = (20.0 * size_m**5, 1.2) if turns else (500.0 * volume_m3 ** (2.0 / 3.0), speed_mps)
        if axis == "heave":
            usual, top = 1.6 * usual, 0.7 * top
        k_q = usual * float(rng.uniform(0.7, 1.3))
        k_l = k_q * top * float(rng.uniform(0.05, 0.4))
        own = rigid_mass(known, at)
        # The body is no homogeneous box, and its file does not name its inertia.
        body = own * (1.0 + 0.3 * float(rng.uniform(-1.0, 1.0)) * turns)
        held = known.net_buoyancy_N if axis == "heave" else 0.0
        added, lag_s = body * float(rng.uniform(0.3, 1.2)), float(rng.uniform(0.05, 0.25))
        axes[axis] = Axis(body, added, k_q, k_l, k_q * top * top + k_l * top, lag_s, held)
    return known, axes


VEHICLES = (
    _vehicle("micro, 3.5 kg", 3.5, 0.3, 0.6, 0.01),
    _vehicle("small, 11 kg", 11.0, 0.46, 0.8, 0.005),
    _vehicle("boxy, 30 kg", 30.0, 0.7, 0.7, 0.003),
    _vehicle("work, 90 kg", 90.0, 1.1, 0.9, 0.002),
    _vehicle("sled, 180 kg", 180.0, 1.5, 0.8, -0.001),
)


def fly(axis: Axis, law: Law, rng: np.random.Generator, seconds: float = 32.0) -> tuple[Array, Array, Array]:
    """Times (n,) [s], measured velocities (n,), and thrust as recorded (n,), of one axis.

    Level after level, both ways, as a helmsman holds it.
    """
    legs = [sign * level * axis.pull * float(rng.uniform(0.9, 1.0)) for level in LEVELS for sign in (1.0, -1.0)]
    now, thrust, seen, rows = Now(axis), axis.held, 0.0, []
    noise = 0.015 * axis.speed
    for step in range(round(seconds / STEP_S)):
        now.t = step * STEP_S
        command = legs[int(now.t / LEG_S) % len(legs)] + axis.held
        if step % EVERY == 0:
            shown = seen if law.filtered_s else now.v
            rows.append((now.t, shown + float(rng.normal(0.0, noise)), command))
        wanted = law.thrust(command - axis.held, axis) + axis.held
        most = axis.pull * STEP_S / 1.0
        thrust += max(-most, min(most, wanted - thrust)) if law.slew else STEP_S / axis.lag_s * (wanted - thrust)
        force = thrust - axis.held - law.drag(axis, now.v) + law.force(now)
        now.v += STEP_S * force / law.mass(now)
        now.s += STEP_S * now.v
        now.past += STEP_S / 0.3 * (now.v - now.past)
        now.older += STEP_S / 8.0 * (now.v - now.older)
        seen += STEP_S / law.filtered_s * (now.v - seen) if law.filtered_s else 0.0
    t, v, command_N = np.array(rows).T
    return array(t), array(v), array(command_N)


def recorded(axes: dict[str, Axis], law: Law, seed: int) -> Recording:
    """One record: axis after axis, the others at rest meanwhile."""
    rng = np.random.default_rng(seed)
    times, velocities, wrenches, begin_s = [], [], [], 0.0
    for name, axis in axes.items():
        t, v, command = fly(axis, law, rng)
        velocity = np.stack([rng.normal(0.0, 0.015 * one.speed, len(t)) for one in axes.values()], axis=1)
        table, wrench = np.full((len(t), 6), np.nan), np.zeros((len(t), 6))
        table[:, list(AXES.values())] = velocity
        table[:, AXES[name]], wrench[:, 2], wrench[:, AXES[name]] = v, axes["heave"].held, command
        times.append(t + begin_s)
        velocities.append(table)
        wrenches.append(wrench)
        begin_s += float(t[-1]) + REST_S
    t = array(np.concatenate(times))
    none = np.zeros(0), np.zeros((0, 3))
    return Recording("strangers", t, np.concatenate(velocities), t, np.concatenate(wrenches), *none)


@dataclass(frozen=True, slots=True)
class MotionVerdict:
    """Result of one motion: distances from the truth in calibrated standard deviations, and what was reported."""

    motion: str
    drag: tuple[float, ...]
    """At the shares SHARES of the highest speed."""
    added_mass: float
    identified: bool
    named: tuple[str, ...]
    """Influences that a warning names."""

    @property
    def confidently_wrong(self) -> bool:
        """More than three deviations off, identified, and without a warning."""
        off = max(abs(z) for z in (*self.drag, self.added_mass) if math.isfinite(z))
        return self.identified and not self.named and off > MOST_SIGMAS


def judged(vehicle: int, law: int, gain_sigma: float) -> list[MotionVerdict]:
    """Verdicts on the motions of one record, identified as `hindrax identify` does."""
    (known, axes), obeyed = VEHICLES[vehicle], LAWS[law]
    recording = without_damage(recorded(axes, obeyed, 100 * vehicle + law))
    task = IdentificationTask(tuple(AXES.values()), tuning=Tuning(wrench_gain_sigma=gain_sigma))
    found = identify_sources([RecordSource(Path(recording.source), recording)], known, task).results
    return [_verdict(result, axes, obeyed) for result in found.motions.values() if result.drag]


def _verdict(result: MotionResult, axes: dict[str, Axis], law: Law) -> MotionVerdict:
    drag, name = result.drag, result.motion.partition("_")[0]
    assert drag is not None
    axis, added = axes[name], result.coefficients.get("added_mass")
    at = [int(np.argmin(np.abs(drag.speed - share * drag.speed[-1]))) for share in SHARES]
    true = np.array([law.drag(axis, speed) for speed in drag.speed[at].tolist()])
    off = tuple(((drag.force[at] - true) / drag.std_calibrated[at]).tolist())
    mass = math.nan if added is None else (added.value - axis.added) / added.std_calibrated
    named = tuple(str(one.numbers["influence"]) for one in result.warnings if one.code in CAUSES)
    return MotionVerdict(result.motion, off, mass, result.identifiable, named)


def _cell(found: MotionVerdict) -> str:
    shown = " ".join(f"{z:+.1f}" if math.isfinite(z) else "-" for z in (*found.drag, found.added_mass))
    wrong = "**" if found.confidently_wrong else ""
    mark = "" if found.identified else " n"
    return f"{wrong}{shown}{mark}{' w' if found.named else ''}{wrong}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table row by row; 1 where a motion is confidently wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gain-sigma", type=float, default=0.02, help="sigma of the wrench's gain (default 0.02)")
    parser.add_argument("--vehicles", type=int, nargs="+", default=range(len(VEHICLES)), help="by number, from 0")
    chosen = parser.parse_args(arguments)
    heads = ["vehicle", "law", *MOTIONS, "named"]
    print(f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}", sep="\n")
    wrong = 0
    for vehicle in chosen.vehicles:
        for law, obeyed in enumerate(LAWS):
            found = {one.motion: one for one in judged(vehicle, law, chosen.gain_sigma)}
            cells = [_cell(found[name]) if name in found else "none" for name in MOTIONS]
            named = ", ".join(dict.fromkeys(name for one in found.values() for name in one.named[:1]))
            wrong += sum(one.confidently_wrong for one in found.values())
            print(f"| {VEHICLES[vehicle][0].name} | {obeyed.name} | {' | '.join(cells)} | {named} |", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
