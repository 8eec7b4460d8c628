"""Axes that are fitted each by itself, in a record in which they move at once: a body that pitches, surges and heaves.

The plant is the equation of motion of a plane (Fossen 2011 eq. 6.43): its added mass is small, so the usual ratio of
total to body mass is wrong, and with it every force by which one axis moves another.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.signals import NAN, Attitude, IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import array
from hindrax_ident.online.coupled_masses import FoundMasses, with_found_masses
from hindrax_ident.online.record_session import RecordSession
from hindrax_ident.online.session import Outcome

pytestmark = pytest.mark.long
VEHICLE = Vehicle(
    name="body",
    mass_kg=10.0,
    volume_m3=0.0101,
    envelope_m=(0.45, 0.35, 0.3),
    inertia_kgm2=(0.25, 0.25, 0.25),
    center_of_buoyancy_m=(0.0, 0.0, -0.06),
)
STEP_S, ROW_S, LASTS_S = 0.01, 0.1, 90.0
SURGE, HEAVE, PITCH = 0, 2, 4
MASS = {SURGE: 10.6, HEAVE: 11.0, PITCH: 0.3}
DRAG = {SURGE: 48.0, HEAVE: 69.0, PITCH: 1.5}
LARGEST = {SURGE: 16.0, HEAVE: 16.0, PITCH: 4.0}
BUOYANCY_N, RIGHTING_Nm = 0.6, 6.0
NOISE = array([0.003] * 3 + [0.002] * 3)
Sticks = Callable[[float], dict[int, float]]


def pilot(seed: int) -> Sticks:
    """All sticks at once, each held for one to three seconds."""
    rng = np.random.default_rng(seed)
    times = {axis: np.cumsum(rng.uniform(1.0, 3.0, 200)) for axis in MASS}
    levels = {axis: rng.choice([-1.0, -0.6, 0.0, 0.6, 1.0], 201) for axis in MASS}
    return lambda t: {axis: LARGEST[axis] * float(levels[axis][np.searchsorted(times[axis], t)]) for axis in MASS}


def legs(t: float) -> dict[int, float]:
    """One axis after the other, back and forth, at four levels."""
    axis = list(MASS)[min(2, int(t // 30.0))]
    step = int(t % 30.0 // 3.4)
    level = (1.0, -1.0, 0.7, -0.7, 0.5, -0.5, 0.85, -0.85, 0.0)[step]
    return {one: LARGEST[one] * level if one == axis else 0.0 for one in MASS}


def flown(sticks: Sticks, seed: int = 1) -> list[Stamped[IdentEvent]]:
    """Velocities, angles and thrusts as another stack would log them."""
    rng = np.random.default_rng(seed)
    u = w = q = pitch = 0.0
    events: list[Stamped[IdentEvent]] = []
    for step in range(round(LASTS_S / STEP_S)):
        t = step * STEP_S
        if step % round(ROW_S / STEP_S) == 0:
            thrust = sticks(t)
            stamp = stamp_from_s(1.0 + t)
            nu = array([u, 0.0, w, 0.0, q, 0.0]) + NOISE * rng.standard_normal(6)
            events.append(Stamped(stamp, Thrust((thrust[SURGE], 0.0, thrust[HEAVE], 0.0, thrust[PITCH], 0.0))))
            events.append(Stamped(stamp, Attitude((0.0, pitch + 1e-3 * rng.standard_normal(), NAN))))
            events.append(Stamped(stamp, Velocity(tuple(nu.tolist()), "record")))
        X = thrust[SURGE] - DRAG[SURGE] * abs(u) * u + BUOYANCY_N * math.sin(pitch) - MASS[HEAVE] * w * q
        Z = thrust[HEAVE] - DRAG[HEAVE] * abs(w) * w - BUOYANCY_N * math.cos(pitch) + MASS[SURGE] * u * q
        munk = (MASS[HEAVE] - MASS[SURGE]) * w * u
        M = thrust[PITCH] - DRAG[PITCH] * abs(q) * q - RIGHTING_Nm * math.sin(pitch) + munk
        u += STEP_S * X / MASS[SURGE]
        w += STEP_S * Z / MASS[HEAVE]
        q += STEP_S * M / MASS[PITCH]
        pitch += STEP_S * q
    return events


class Fits:
    """What each pass over a record was given, and what the last one found."""

    def __init__(self, events: Sequence[Stamped[IdentEvent]]) -> None:
        self.sessions = RecordSession(VEHICLE)
        for _ in self.sessions.step(*events):
            pass
        self.given: list[FoundMasses] = []
        self.outcomes = with_found_masses(VEHICLE, self.fit_all)
        self.motions = {name: one for outcome in self.outcomes for name, one in outcome.results.motions.items()}

    def fit_all(self, masses: FoundMasses) -> list[Outcome]:
        """One pass."""
        self.given.append(masses)
        return [one.finalize(found_masses=masses) for one in self.sessions.pushed]


@pytest.fixture(scope="module")
def fits() -> Fits:
    return Fits(flown(pilot(1)))


@pytest.mark.parametrize(("name", "axis"), [("surge", SURGE), ("heave_down", HEAVE), ("heave_up", HEAVE)])
def test_drag_is_right_although_the_axes_move_at_once(fits: Fits, name: str, axis: int) -> None:
    motion = fits.motions[name]
    assert motion.identifiable, motion.reasons
    assert motion.drag is not None
    drag, true = float(motion.drag.force[-1]), DRAG[axis] * float(motion.drag.speed[-1]) ** 2
    assert drag == pytest.approx(true, rel=0.06)
    assert abs(drag - true) < 2.0 * float(motion.drag.std_calibrated[-1])


def test_masses_are_those_of_the_plant_and_never_below_that_of_the_body(fits: Fits) -> None:
    assert not fits.given[0], "nothing is known before the first fit"
    for axis in (SURGE, HEAVE):
        mass, sigma = fits.given[-1][axis]
        assert mass >= VEHICLE.mass_kg
        assert abs(mass - MASS[axis]) < 2.0 * sigma < MASS[axis]


def test_an_axis_alone_tells_the_masses_of_the_others(fits: Fits) -> None:
    """The usual ratio is 70 % too high here. What it does was feared to 32 % of the drag, and not looked for."""
    (heave,) = (one for one in fits.sessions.pushed if HEAVE in one.axes)
    found = heave.finalize().results.motions
    for name in ("heave_down", "heave_up"):
        drag = found[name].drag
        assert drag is not None
        force, std = float(drag.force[-1]), float(drag.std_calibrated[-1])
        assert abs(force - DRAG[HEAVE] * float(drag.speed[-1]) ** 2) < 2.0 * std
        assert std < 0.25 * force


def test_an_axis_that_is_known_every_other_time_is_known_still(fits: Fits) -> None:
    """Of a simulated BlueROV2 pitch was so: all axes were fitted five times, for no other masses."""
    given: list[FoundMasses] = []

    def fit_all(masses: FoundMasses) -> list[Outcome]:
        given.append(masses)
        return [_known(one, {SURGE: True, HEAVE: len(given) % 2 > 0}) for one in fits.outcomes]

    with_found_masses(VEHICLE, fit_all)
    assert [sorted(one) for one in given] == [[], [SURGE, HEAVE]]


def _known(outcome: Outcome, axes: Mapping[int, bool]) -> Outcome:
    """The outcome with only these axes' fits converged."""
    found = {
        axis: replace(one, fit=replace(one.fit, converged=axes.get(axis, False)))
        for axis, one in outcome.assessments.items()
    }
    return replace(outcome, assessments=found)


def test_axes_that_move_one_after_the_other_are_fitted_once() -> None:
    one_by_one = Fits(flown(legs))
    assert {"surge", "heave_down", "heave_up", "pitch"} == set(one_by_one.motions)
    assert one_by_one.given == [{}]
