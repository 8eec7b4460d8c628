"""All axes in one fit: a plant with coupled masses whose six axes move at once, and what a joint fit must not do."""

import dataclasses
import math

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.joint_assessment import joint_results
from hindrax_ident.assess.objections import Code
from hindrax_ident.fit.joint import Delays, JointFit, fit_jointly
from hindrax_ident.model.six_axes import inertial_force
from hindrax_ident.records.six_axis_record import SixAxisRecord, six_axis_record

VEHICLE = Vehicle(
    name="body",
    mass_kg=11.5,
    volume_m3=0.0115,
    envelope_m=(0.45, 0.35, 0.3),
    inertia_kgm2=(0.20, 0.24, 0.26),
    center_of_buoyancy_m=(0.0, 0.0, -0.02),
)
STEP_S, LASTS_S, LAG_S = 0.01, 45.0, 0.12
DRAG = array([50.0, 90.0, 95.0, 0.4, 0.6, 0.6])
RIGHTING_Nm = VEHICLE.buoyancy_N * 0.02
SURGE, PITCH = 0, 4
COUPLING = -0.5
GUST = 0.015
NOISE = array([0.006] * 3 + [0.003] * 3)
DELAYS = Delays((0.15, 0.05, 0.0), (0.1, 0.1, 0.03))


def mass() -> Array:
    """Total mass with surge and pitch coupled: (6, 6)."""
    M = np.diag([14.0, 20.0, 22.0, 0.26, 0.28, 0.30])
    M[SURGE, PITCH] = M[PITCH, SURGE] = COUPLING
    return array(M)


def flown(M: Array, seed: int = 1, sines: int = 8) -> SixAxisRecord:
    """All axes moved at once by sines, level enough for roll and pitch to be small; the truth is the equation."""
    rng = np.random.default_rng(seed)
    rates, phases = rng.uniform(0.1, 0.5, (6, sines)), rng.uniform(0.0, math.tau, (6, sines))
    largest = array([15.0, 18.0, 18.0, 0.5, 0.5, 1.5])
    inverse = np.linalg.inv(M)
    nu, angles, thrust, command, gusts = (array(np.zeros(n)) for n in (6, 2, 6, 6, 6))
    wrench, velocity, attitude = [], [], []

    def acceleration(nu: Array) -> Array:
        """Acceleration at a velocity: (6,)."""
        resisting = inertial_force(M, nu[None], np.zeros((1, 6)))[0] + DRAG * np.abs(nu) * nu
        resisting[3:5] += RIGHTING_Nm * np.sin(angles) * [np.cos(angles[1]), 1.0]
        return array(inverse @ (thrust * (1.0 + gusts) - resisting))

    for step in range(round(LASTS_S / STEP_S)):
        t = step * STEP_S
        if step % 5 == 0:
            command = largest * math.sqrt(2.0 / sines) * np.sin(math.tau * rates * t + phases).sum(axis=1)
            wrench.append((t, *command))
            velocity.append((t, *(nu + NOISE * rng.standard_normal(6))))
            attitude.append((t, *(angles + 0.003 * rng.standard_normal(2)), math.nan))
        thrust = array(thrust + (command - thrust) * (1.0 - math.exp(-STEP_S / LAG_S)))
        gusts = array(0.9 * gusts + GUST * rng.standard_normal(6))
        middle = nu + 0.5 * STEP_S * acceleration(nu)
        nu = array(nu + STEP_S * acceleration(array(middle)))
        roll, pitch = angles
        turned = middle[4] * math.sin(roll) + middle[5] * math.cos(roll)
        rates_of = [middle[3] + turned * math.tan(pitch), middle[4] * math.cos(roll) - middle[5] * math.sin(roll)]
        angles = array(angles + STEP_S * array(rates_of))
    v, w, a = (array(rows) for rows in (velocity, wrench, attitude))
    return six_axis_record((v[:, 0], v[:, 1:]), (w[:, 0], w[:, 1:]), (a[:, 0], a[:, 1:]), gap_s=1.0)


@pytest.fixture(scope="module")
def record() -> SixAxisRecord:
    return flown(mass())


@pytest.fixture(scope="module")
def fit(record: SixAxisRecord) -> JointFit:
    return fit_jointly(record, VEHICLE, DELAYS, gain_sigma=0.02)


def sigmas(fit: JointFit) -> Array:
    return array(np.sqrt(np.diag(fit.covariance + fit.by_doubt @ fit.by_doubt.T)))


def test_masses_drag_and_delay_are_found_while_everything_moves(fit: JointFit) -> None:
    off = {}
    for name, true in zip(("surge", "sway", "roll", "pitch", "yaw"), DRAG[[0, 1, 3, 4, 5]].tolist(), strict=True):
        place = fit.index(f"{name} k_q")
        assert fit.theta[place] == pytest.approx(true, rel=0.15), name
    for place, term in enumerate(fit.terms):
        if term.mass and term.mass[0] == term.mass[1]:
            off[term.name] = (fit.theta[place] - mass()[term.mass]) / sigmas(fit)[place]
            assert fit.theta[place] == pytest.approx(mass()[term.mass], rel=0.06), term.name
    assert max(map(abs, off.values())) < 3.0, off
    lag, latency, _ = fit.theta[:3]
    assert lag + latency == pytest.approx(LAG_S, abs=0.01)
    assert fit.converged


def test_the_coupled_mass_is_admitted_and_no_other(fit: JointFit) -> None:
    admitted = {term.name for term in fit.terms if term.mass and term.mass[0] != term.mass[1]}
    assert admitted == {"M_Xq"}
    place = fit.index("M_Xq")
    assert fit.theta[place] == pytest.approx(COUPLING, abs=3.0 * sigmas(fit)[place])
    assert fit.M[SURGE, PITCH] == fit.M[PITCH, SURGE] == fit.theta[place]
    assert fit.odds["M_Xq"] > 10.0


def test_the_mass_is_positive_definite_and_drag_takes_energy(fit: JointFit) -> None:
    assert np.linalg.eigvalsh(fit.M).min() > 0.0
    assert all(fit.theta[place] >= 0.0 for place, term in enumerate(fit.terms) if term.drag_power)


def test_an_axis_whose_thrust_has_two_frequencies_is_not_identified(fit: JointFit) -> None:
    whirl = flown(mass(), sines=2)
    assert all(1.0 < whirl.frequencies(axis) < 3.0 for axis in range(6))
    few = dataclasses.replace(fit, frequencies=array([whirl.frequencies(axis) for axis in fit.axes]))
    for name, motion in joint_results(few, VEHICLE).motions.items():
        assert Code.FEW_FREQUENCIES in {one.code for one in motion.reasons}, name


def test_a_thrust_that_no_thruster_gives_so_late_identifies_nothing(fit: JointFit) -> None:
    """A filter of the velocities is a slow thruster to a fit without one, and the masses are wrong by what it holds."""
    slow = dataclasses.replace(fit, theta=array(np.concatenate([[0.56], fit.theta[1:]])))
    for motion in joint_results(slow, VEHICLE).motions.values():
        (reason,) = [one for one in motion.reasons if one.code is Code.SLOW_THRUST]
        assert reason.startswith("the thrust acts 0.56 s late in this fit, wanted 0.45 s at most")
    known = dataclasses.replace(slow, terms=(dataclasses.replace(fit.terms[0], mean=0.5), *fit.terms[1:]))
    codes = [one.code for motion in joint_results(known, VEHICLE).motions.values() for one in motion.reasons]
    assert Code.SLOW_THRUST not in codes, "one whose lag the vehicle file has"


def test_thrusters_whose_moments_are_unknown_push_with_unknown_forces_too(fit: JointFit) -> None:
    """One of four wired backwards: surge was identified with k_q 25 +- 12 for 80, while yaw was not."""
    sizes = array(0.3 * fit.scales.pull[list(fit.axes)])
    sizes[fit.axes.index(5)] = 0.7 * fit.scales.pull[5]
    unknown = joint_results(dataclasses.replace(fit, force_sigma=sizes), VEHICLE)
    reasons = {
        name: [one for one in motion.reasons if one.code is Code.UNKNOWN_FORCES]
        for name, motion in unknown.motions.items()
    }
    assert {name for name, found in reasons.items() if found} == {"surge", "sway", "yaw"}
    assert "of the largest thrust in yaw: check the direction of each thruster" in reasons["surge"][0]
    assert "of the largest thrust: check the direction" in reasons["yaw"][0]


def test_results_have_the_matrix_a_budget_and_verdicts(fit: JointFit) -> None:
    found = joint_results(fit, VEHICLE)
    document = found.to_json()
    assert found.added_mass[SURGE, SURGE] == pytest.approx(2.5, abs=0.8)
    assert found.added_mass_std[SURGE, 1] == 0.0 < found.added_mass_std[SURGE, PITCH]
    assert set(document) == {"M_A", "M_A_std", "terms", "delays", "converged", "motions"}
    surge = found.motions["surge"]
    assert not surge.reasons
    total = math.sqrt(sum(row.std**2 for row in surge.budget))
    assert total == pytest.approx(float(surge.drag.std_calibrated[-1]), rel=1e-6), "rows add up"
    off = float(surge.drag.force[-1]) - 50.0 * float(surge.drag.speed[-1]) ** 2
    assert abs(off) < 2.0 * float(surge.drag.std_calibrated[-1]) < 0.35 * float(surge.drag.force[-1])


def test_an_axis_that_was_not_measured_is_left_out(record: SixAxisRecord) -> None:
    missing = dataclasses.replace(record.velocities[3], t=array([]), y=array([]))
    velocities = (*record.velocities[:3], missing, *record.velocities[4:])
    assert dataclasses.replace(record, velocities=velocities).axes == (0, 1, 2, 4, 5)
    alone = (record.velocities[0], *[missing] * 5)
    with pytest.raises(ValueError, match="fitted axis by axis"):
        fit_jointly(dataclasses.replace(record, velocities=alone), VEHICLE, DELAYS, gain_sigma=0.02)


def test_an_axis_on_which_thrusters_cancel_is_left_out(record: SixAxisRecord) -> None:
    wrench = record.wrench * np.array([1.0, 1e-15, 1.0, 1.0, 1.0, 1e-15])
    assert dataclasses.replace(record, wrench=array(wrench)).axes == (0, 2, 3, 4)


def test_energy_is_kept_by_inertial_forces() -> None:
    """C(M) does no work: v' C(M) v = 0, for any symmetric M."""
    rng = np.random.default_rng(3)
    half = rng.standard_normal((6, 6))
    nu = rng.standard_normal((50, 6))
    of_motion = inertial_force(array(half @ half.T), nu, np.zeros_like(nu))
    assert np.abs(np.sum(nu * of_motion, axis=1)).max() < 1e-12
