"""A record of places instead of velocities: fitted as it is, with the noise, steps and outliers of its instrument."""

import math
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_analysis.records.bag_track import velocities_from_poses, ways_from_poses
from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.recording import NO_TIMES, NO_WAYS, Recording, reason_to_skip
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import MotionResult

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
STEP_S, SPAN_S = 0.05, 60.0
K_Q, K_L, MASS = 60.0, 5.0, 25.0
HEADING_rad = 0.7


def legs() -> tuple[Array, Array, Array]:
    """Times [s], the true way ahead [m] and the thrust [N] of legs forth and back."""
    t = array(np.arange(0.0, SPAN_S, STEP_S))
    force = np.where(t % 20.0 < 10.0, 20.0, 8.0) * np.where(t % 10.0 < 5.0, 1.0, -1.0)
    ways, way, speed = [], 0.0, 0.0
    for one in force.tolist():
        ways.append(way)
        for _ in range(10):
            speed += 0.1 * STEP_S * (one - K_Q * abs(speed) * speed - K_L * speed) / MASS
            way += 0.1 * STEP_S * speed
    return t, array(np.array(ways)), array(force)


def recorded(way: Array, *, poses_sigma_m: float, rng: np.random.Generator) -> tuple[Recording, Recording]:
    """The legs as poses show them, as positions to fit, and differentiated."""
    t, _, force = legs()
    wrench = np.zeros((len(t), 6))
    wrench[:, 0] = force
    ahead = np.array([np.cos(HEADING_rad), np.sin(HEADING_rad), 0.0])
    yaw = 0.5 * (HEADING_rad + 0.01 * rng.standard_normal(len(t)))
    attitudes = array(np.column_stack([np.zeros((len(t), 2)), np.sin(yaw), np.cos(yaw)]))
    places = array(way[:, None] * ahead + poses_sigma_m * rng.standard_normal((len(t), 3)))
    moving = velocities_from_poses(t, places, attitudes)
    fitted = Recording(
        "poses", *moving, t, array(wrench), NO_TIMES, NO_WAYS, way_t=t, way=ways_from_poses(places, attitudes)
    )
    return fitted, Recording("slopes", *moving, t, array(wrench), NO_TIMES, NO_WAYS)


def identified(recording: Recording, axis: int = 0) -> MotionResult:
    task = IdentificationTask(axes=(axis,))
    return identify_sources([RecordSource(Path("made"), recording)], VEHICLE, task).results.motions[AXES[axis]]


def test_positions_are_fitted_and_not_differentiated() -> None:
    _, way, _ = legs()
    fitted, slopes = recorded(way, poses_sigma_m=0.02, rng=np.random.default_rng(4))
    by_places, by_slopes = identified(fitted), identified(slopes)
    true_N = K_Q * 0.5**2 + K_L * 0.5
    found_N, std_N = by_places.drag_force(0.5)
    assert abs(found_N - true_N) < 2.5 * std_N
    assert std_N < 0.1 * true_N
    assert by_places.coefficients["added_mass"].std < by_slopes.coefficients["added_mass"].std
    assert by_places.samples > by_slopes.samples


def test_places_that_are_off_do_not_count() -> None:
    """A sonar that finds something nearer now and then."""
    _, way, _ = legs()
    rng = np.random.default_rng(5)
    clean, _ = recorded(way, poses_sigma_m=0.005, rng=rng)
    off = clean.way.copy()
    off[rng.choice(len(off), 25, replace=False), 0] += 1.5
    spoiled = Recording(
        "spoiled", clean.velocity_t, clean.velocity, clean.wrench_t, clean.wrench, NO_TIMES, NO_WAYS,
        way_t=clean.way_t, way=array(off),
    )  # fmt: skip
    found_N, std_N = identified(spoiled).drag_force(0.5)
    assert abs(found_N - K_Q * 0.5**2 - K_L * 0.5) < 2.5 * std_N
    assert std_N < 0.1 * found_N


def test_a_file_of_positions_and_headings_is_identified() -> None:
    t, way, force = legs()
    x, y = way * np.cos(HEADING_rad), way * np.sin(HEADING_rad)
    rows = zip(t, np.round(x, 3), np.round(y, 3), force, strict=True)
    lines = [f"{a:.2f},{b:.3f},{c:.3f},{HEADING_rad:.3f},{d:.1f}" for a, b, c, d in rows]
    (found,) = read_records("\n".join(["t,px_m,position.y [m],heading,X", *lines]), "places.csv")
    assert found.way[:, 0] == pytest.approx(way - way[0], abs=0.003)
    assert found.way[:, 1] == pytest.approx(0.0, abs=0.003)
    assert not reason_to_skip(found, 0)
    assert reason_to_skip(found, 1)


def test_a_measured_velocity_goes_before_a_position() -> None:
    (found,) = read_records("t,u,px,py,yaw,X\n0,0.1,0,0,0,1\n1,0.1,0.1,0,0,1\n", "both.csv")
    assert np.isnan(found.way[:, [0, 2]]).all()
    assert found.way[:, 1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("sigma_m", [0.0, 0.002])
def test_exact_places_as_of_a_simulator_are_identified_too(sigma_m: float) -> None:
    t, way, force = legs()
    noisy = way + np.random.default_rng(3).normal(0.0, sigma_m, len(way))
    rows = zip(t, noisy * math.cos(HEADING_rad), noisy * math.sin(HEADING_rad), force, strict=True)
    lines = [f"{t:.2f},{x:.12f},{y:.12f},{HEADING_rad},{push}" for t, x, y, push in rows]
    (recording,) = read_records("\n".join(["t,px,py,yaw,X", *lines]), "a.csv")
    assert (len(recording.way_t) == 0) == (sigma_m == 0.0)
    found = identified(recording)
    assert found.identifiable, found.reasons
    assert found.value("k_q") * 0.36 + found.value("k_l") * 0.6 == pytest.approx(0.36 * K_Q + 0.6 * K_L, rel=0.03)
