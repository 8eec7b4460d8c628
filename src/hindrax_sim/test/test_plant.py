import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_control.allocation.thrust_curve import ThrustCurve
from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.thrust.curves import Curve
from hindrax_core.thrust.table import ThrustTable
from hindrax_core.vehicle import AXES, Drag, Hydrodynamics, Vehicle, load_vehicle
from hindrax_ident.arrays import Array
from hindrax_sim.conditions.realization import Realization
from hindrax_sim.physics.geometry import euler, quaternion, rotate
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.thruster import steady_force, thruster_force, wrench_per_newton

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
DT = 0.002
speed = st.floats(-1.0, 1.0)
angle = st.floats(-1.2, 1.2)
NO_DRAG = Hydrodynamics(added_mass=(12.0, 19.0, 22.0, 0.25, 0.45, 0.35))


def neutral(vehicle: Vehicle = VEHICLE) -> Vehicle:
    """As heavy as the water it displaces, so that it stays where it is put."""
    return replace(vehicle, volume_m3=vehicle.mass_kg / vehicle.water.density_kgpm3)


def deep(vehicle: Vehicle, *, attitude: Vec3 = (0.0, 0.0, 0.0), nu: Vec6 = (0.0,) * 6) -> Plant:
    plant = Plant(vehicle)
    plant.place((0.0, 0.0, 5.0), attitude)
    plant.u, plant.v, plant.w, plant.p, plant.q, plant.r = nu
    return plant


def hydrodynamics_of(vehicle: Vehicle) -> Hydrodynamics:
    assert vehicle.hydrodynamics is not None
    return vehicle.hydrodynamics


def rows_of(matrix: Array) -> tuple[Vec6, ...]:
    return tuple((a, b, c, d, e, f) for a, b, c, d, e, f in matrix.tolist())


def run(plant: Plant, seconds: float, dt: float = DT) -> Plant:
    for _ in range(round(seconds / dt)):
        plant.step(dt)
    return plant


def kinetic_energy_J(plant: Plant) -> float:
    """Energy of body and entrained water for the motion through the water (diagonal added mass only)."""
    squares = (value * value for value in (plant.u, plant.v, plant.w, plant.p, plant.q, plant.r))
    return 0.5 * sum(mass * square for mass, square in zip(plant._inertia, squares, strict=True))


def potential_energy_J(plant: Plant) -> float:
    """Energy of height and tilt, fully under water; zero for a level vehicle at the surface."""
    _, net, bx, by, bz = plant._statics
    dx, dy, dz = plant._into_body((0.0, 0.0, 1.0))
    return bx * dx + by * dy + bz * (dz - 1.0) - net * plant.z


def energy(plant: Plant) -> float:
    return kinetic_energy_J(plant) + potential_energy_J(plant)


@settings(max_examples=10, deadline=None)
@given(st.tuples(speed, speed, speed, speed, speed, speed), st.tuples(angle, angle, angle))
def test_without_drag_and_thrust_the_energy_stays(nu: Vec6, attitude: Vec3) -> None:
    plant = deep(replace(VEHICLE, hydrodynamics=NO_DRAG), attitude=attitude, nu=nu)
    before = energy(plant)
    run(plant, 1.0, 0.0005)
    assert energy(plant) == pytest.approx(before, abs=0.005 + 0.004 * kinetic_energy_J(plant))


@settings(max_examples=10, deadline=None)
@given(st.tuples(speed, speed, speed, speed, speed, speed), st.tuples(angle, angle, angle))
def test_drag_only_takes_energy(nu: Vec6, attitude: Vec3) -> None:
    plant = deep(VEHICLE, attitude=attitude, nu=nu)
    before = energy(plant)
    for _ in range(10):
        run(plant, 0.2)
        assert energy(plant) <= before + 1e-3
        before = energy(plant)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(1100, 1900), min_size=8, max_size=8))
def test_the_power_of_all_forces_is_the_change_of_energy(pulses: list[int]) -> None:
    plant = deep(VEHICLE, nu=(0.3, -0.2, 0.1, 0.2, -0.1, 0.3))
    plant.drive(pulses)
    hydro = hydrodynamics_of(VEHICLE)
    before, work = energy(plant), 0.0
    for _ in range(1000):
        was = (plant.u, plant.v, plant.w, plant.p, plant.q, plant.r)
        plant.step(0.001)
        nu = [0.5 * (a + b) for a, b in zip(was, (plant.u, plant.v, plant.w, plant.p, plant.q, plant.r), strict=True)]
        for axis, x, force in zip(AXES, nu, plant.thrust, strict=True):
            drag = hydro.drag(axis)
            quadratic = drag.k_q_negative if x < 0 and drag.k_q_negative is not None else drag.k_q
            linear = drag.k_l_negative if x < 0 and drag.k_l_negative is not None else drag.k_l
            work += 0.001 * (force * x - (quadratic * abs(x) + linear) * x * x)
    assert energy(plant) - before == pytest.approx(work, rel=5e-3, abs=0.05)


@pytest.mark.parametrize(("pulses", "axis", "along"), [
    ((1700, 1700, 1500, 1500), "surge", "u"),
    ((1300, 1300, 1500, 1500), "surge", "u"),
    ((1700, 1500, 1700, 1500), "sway", "v"),
    ((1700, 1300, 1700, 1300), "sway", "v"),
])  # fmt: skip
def test_terminal_velocity_is_where_drag_equals_thrust(
    pulses: tuple[int, int, int, int], axis: str, along: str
) -> None:
    at_the_middle = tuple(replace(one, position_m=(*one.position_m[:2], 0.0)) for one in VEHICLE.thrusters)
    plant = deep(neutral(replace(VEHICLE, thrusters=at_the_middle)))
    plant.drive([*pulses, 1500, 1500, 1500, 1500])
    run(plant, 15.0, 0.005)
    force, drag = plant.thrust[AXES.index(axis)], hydrodynamics_of(VEHICLE).drag(axis)
    root = (-drag.k_l + math.sqrt(drag.k_l**2 + 4 * drag.k_q * abs(force))) / (2 * drag.k_q)
    assert getattr(plant, along) == pytest.approx(math.copysign(root, force), rel=2e-3)


@pytest.mark.parametrize(("net_N", "k_q", "k_l"), [(2.0, 93.52, 5.26), (-2.0, 56.57, 11.84)])
def test_heave_sinks_and_rises_with_its_own_drag(net_N: float, k_q: float, k_l: float) -> None:
    weight = VEHICLE.buoyancy_N + net_N
    plant = run(deep(replace(VEHICLE, mass_kg=weight / 9.80665)), 20.0, 0.005)
    root = (-k_l + math.sqrt(k_l**2 + 4 * k_q * abs(net_N))) / (2 * k_q)
    assert plant.w == pytest.approx(math.copysign(root, net_N), rel=1e-3)


def test_free_decay_in_roll_has_the_period_and_decrement_of_a_damped_pendulum() -> None:
    damping = 0.3
    hydro = replace(NO_DRAG, roll=Drag(0.0, damping))
    vehicle = neutral(replace(VEHICLE, hydrodynamics=hydro))
    plant = deep(vehicle, attitude=(0.05, 0.0, 0.0))
    inertia = vehicle.inertia[0] + 0.25
    stiffness = vehicle.weight_N * 0.02
    peaks, last = [], (0.0, 0.0)
    for number in range(12000):
        plant.step(0.001)
        now = (plant.p, euler(plant.quaternion)[0])
        if last[0] > 0.0 >= now[0]:
            peaks.append((number * 0.001, now[1]))
        last = now
    period = peaks[1][0] - peaks[0][0]
    damped = math.sqrt(stiffness / inertia - (damping / (2 * inertia)) ** 2)
    assert period == pytest.approx(2 * math.pi / damped, rel=2e-3)
    assert math.log(peaks[0][1] / peaks[1][1]) == pytest.approx(damping / (2 * inertia) * period, rel=0.01)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(1100, 1900), min_size=8, max_size=8))
def test_port_and_starboard_are_mirror_images(pulses: list[int]) -> None:
    mirrored = [pulses[i] for i in (1, 0, 3, 2, 5, 4, 7, 6)]
    left, right = deep(VEHICLE), deep(VEHICLE)
    left.drive(pulses)
    right.drive(mirrored)
    run(left, 2.0)
    run(right, 2.0)
    signs = (1, -1, 1, -1, 1, -1)
    for name, sign in zip("uvwpqr", signs, strict=True):
        assert getattr(left, name) == pytest.approx(sign * getattr(right, name), abs=1e-9)


@pytest.mark.parametrize("dt", [0.001, 0.002, 0.005])
def test_the_length_of_the_step_does_not_change_the_apparent_inertia(dt: float) -> None:
    # An Euler step that takes drag at its beginning makes the vehicle lighter by half a step times the drag's slope.
    hydro = replace(NO_DRAG, surge=Drag(0.0, 40.0))
    plant = deep(neutral(replace(VEHICLE, hydrodynamics=hydro)), nu=(0.4, 0, 0, 0, 0, 0))
    run(plant, 0.5, dt)
    inertia = VEHICLE.mass_kg + 12.0
    assert -40.0 * 0.5 / math.log(plant.u / 0.4) == pytest.approx(inertia, rel=2e-4)


def test_munk_moment_turns_an_oblique_body_towards_broadside() -> None:
    # Fossen 2011 section 6.3: N = -(Yvdot - Xudot) u v; with more added mass in sway than in surge, drift grows.
    plant = deep(neutral(replace(VEHICLE, hydrodynamics=NO_DRAG)), nu=(1.0, 0.1, 0, 0, 0, 0))
    plant.step(1e-4)
    assert plant.dr == pytest.approx((12.0 - 19.0) * 1.0 * 0.1 / (VEHICLE.inertia[2] + 0.35), rel=1e-3)


def test_off_diagonal_added_mass_may_be_unsymmetric() -> None:
    cross = np.zeros((6, 6))
    cross[2, 4], cross[4, 2] = 1.5, 0.7
    hydro = replace(NO_DRAG, added_mass_cross=rows_of(cross))
    vehicle = neutral(replace(VEHICLE, hydrodynamics=hydro, center_of_buoyancy_m=(0.0, 0.0, 0.0)))
    plant = deep(vehicle)
    plant.drive([1500, 1500, 1500, 1500, 1700, 1700, 1700, 1700])
    run(plant, 1.5)
    plant.place((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    plant.step(1e-6)
    m, Iy = vehicle.mass_kg, vehicle.inertia[1]
    whole = np.diag([m + 12, m + 19, m + 22, vehicle.inertia[0] + 0.25, Iy + 0.45, vehicle.inertia[2] + 0.35]) + cross
    wanted = np.linalg.solve(whole, plant.thrust)
    assert [plant.du, plant.dv, plant.dw, plant.dp, plant.dq, plant.dr] == pytest.approx(wanted, abs=1e-6)
    assert plant.dq != 0.0


def test_symmetric_coupling_keeps_the_energy() -> None:
    cross = np.zeros((6, 6))
    cross[2, 4] = cross[4, 2] = 1.5
    cross[1, 5] = cross[5, 1] = -1.0
    whole = np.diag([VEHICLE.mass_kg] * 3 + list(VEHICLE.inertia)) + np.diag(NO_DRAG.added_mass) + cross
    hydro = replace(NO_DRAG, added_mass_cross=rows_of(cross))
    plant = deep(
        neutral(replace(VEHICLE, hydrodynamics=hydro, center_of_buoyancy_m=(0.0, 0.0, 0.0))),
        nu=(0.5, 0.3, 0.2, 0.3, 0.2, 0.4),
    )
    nu = np.array([plant.u, plant.v, plant.w, plant.p, plant.q, plant.r])
    before = nu @ whole @ nu
    run(plant, 2.0, 0.0005)
    nu = np.array([plant.u, plant.v, plant.w, plant.p, plant.q, plant.r])
    assert nu @ whole @ nu == pytest.approx(before, rel=2e-3)


@pytest.mark.parametrize("cross", [((0.0,) * 6,) * 5, tuple((9.0,) * 6 for _ in range(6))])
def test_added_mass_that_cannot_be_is_refused(cross: tuple[Vec6, Vec6, Vec6, Vec6, Vec6] | tuple[Vec6, ...]) -> None:
    with pytest.raises(UsageError, match=r"added_mass_cross: wanted 6 rows"):
        Plant(replace(VEHICLE, hydrodynamics=replace(NO_DRAG, added_mass_cross=cross)))


def test_energy_that_could_be_negative_is_refused() -> None:
    cross = np.zeros((6, 6))
    cross[2, 4] = 50.0
    with pytest.raises(UsageError, match="energy can be negative"):
        Plant(replace(VEHICLE, hydrodynamics=replace(NO_DRAG, added_mass_cross=rows_of(cross))))


def test_a_vehicle_file_without_hydrodynamics_cannot_be_mocked() -> None:
    bare = replace(VEHICLE, hydrodynamics=None)
    for make in (Plant, lambda vehicle: Realization(vehicle).hydrodynamics):
        with pytest.raises(UsageError, match=r"hydrodynamics: missing, .*`./hindrax estimate --vehicle FILE` prints"):
            make(bare)


def test_center_of_mass_ahead_lifts_the_bow_by_buoyancy() -> None:
    ahead = deep(neutral(replace(VEHICLE, center_of_mass_m=(0.05, 0.0, 0.0))))
    ahead.step(DT)
    assert ahead.dq < 0.0  # heavy nose: nose down
    assert ahead.dw == pytest.approx(0.0, abs=1e-9)


def test_it_floats_with_the_draft_that_carries_its_weight() -> None:
    plant = Plant(VEHICLE)
    plant.place((0.0, 0.0, 0.1), (0.0, 0.0, 0.0))
    run(plant, 60.0, 0.005)
    height = VEHICLE.envelope_m[2]
    assert plant.z + height / 2 == pytest.approx(height * VEHICLE.weight_N / VEHICLE.buoyancy_N, abs=2e-3)


def test_a_drifting_vehicle_ends_up_with_the_water() -> None:
    plant = deep(neutral())
    plant.current_mps = (0.15, 0.05, 0.0)
    assert plant.velocity_over_ground == pytest.approx((0.0, 0.0, 0.0))
    run(plant, 200.0, 0.005)
    u, v, _ = plant.velocity_over_ground
    turned = rotate(plant.quaternion, (u, v, 0.0))
    assert turned[:2] == pytest.approx((0.15, 0.05), abs=0.03)


def test_ground_covered_in_body_axes_is_the_way_over_ground() -> None:
    plant = deep(neutral())
    plant.current_mps = (0.1, 0.0, 0.0)
    plant.drive([1600, 1600, 1500, 1500, 1500, 1500, 1500, 1500])
    run(plant, 5.0)
    assert (plant.sx, plant.sy) == pytest.approx((plant.x, plant.y), abs=2e-3)


@given(st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)))
def test_euler_angles_and_quaternions_are_inverses(attitude: Vec3) -> None:
    assert euler(quaternion(attitude)) == pytest.approx(attitude, abs=1e-9)


def test_turning_over_the_pole_keeps_the_attitude_finite() -> None:
    plant = deep(
        neutral(replace(VEHICLE, hydrodynamics=NO_DRAG, center_of_buoyancy_m=(0.0, 0.0, 0.0))), nu=(0, 0, 0, 0, 1.0, 0)
    )
    run(plant, 2 * math.pi)
    assert sum(x * x for x in plant.quaternion) == pytest.approx(1.0)
    assert euler(plant.quaternion) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


CURVE = VEHICLE.curves["main"]


@pytest.mark.parametrize(("pulse", "force"), [(1100, -15.528), (1300, -8.154), (1700, 8.154), (1900, 15.528)])
def test_thrust_is_table_2_of_the_paper_and_its_mirror(pulse: int, force: float) -> None:
    # COB-2023-1394 Table 2, negative row: -15.5 N at 1100 us and -8.15 N at 1300 us.
    assert steady_force(CURVE, pulse, 14.8) == pytest.approx(force, abs=1e-3)


@given(st.floats(1475.001, 1524.999))
def test_the_dead_band_gives_nothing(pulse: float) -> None:
    assert steady_force(CURVE, pulse, 14.8) == 0.0


def test_beyond_the_ends_and_without_signal() -> None:
    assert steady_force(CURVE, 1000, 14.8) == steady_force(CURVE, 1100, 14.8)
    assert thruster_force(VEHICLE, VEHICLE.thrusters[0], 0.0, 14.8) == 0.0


@given(st.floats(1000, 2000))
def test_a_reversed_thruster_is_the_mirror(pulse: float) -> None:
    one = VEHICLE.thrusters[0]
    turned = replace(one, reversed=True)
    assert thruster_force(VEHICLE, turned, pulse, 14.8) == pytest.approx(
        thruster_force(VEHICLE, one, 3000.0 - pulse, 14.8), abs=1e-9
    )


# A branch that begins outside the dead band, at it, inside it, and without one; positive branches given and mirrored.
NEGATIVE = CURVE.negative
CURVES = [
    replace(CURVE, dead_band_us=band, negative=replace(NEGATIVE, to_us=1460.0), positive=positive)
    for band in (0.0, 25.0, 40.0, 60.0)
    for positive in (None, replace(NEGATIVE.reflected(1500.0).scaled(-0.8), from_us=1550.0))
]
TABLE = ThrustTable(
    (1100.0, 1110.0, 1300.0, 1460.0, 1470.0, 1500.0, 1530.0, 1540.0, 1900.0),
    (12.0, 16.0),
    ((-28.0, -28.0, -10.0, -0.3, 0.0, 0.0, 0.0, 0.4, 36.0), (-40.0, -39.0, -15.0, -0.7, -0.3, 0.0, 0.4, 0.8, 51.0)),
)
CURVES += [Curve(table=TABLE), Curve(table=replace(TABLE, supply_V=(14.0, 16.0)))]


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("turned", [False, True])
def test_mock_and_stack_read_a_curve_alike(curve: Curve, turned: bool) -> None:
    stack = ThrustCurve(curve, 13.0, mirrored=turned)
    vehicle = replace(VEHICLE, curves={"main": curve})
    thruster = replace(vehicle.thrusters[0], reversed=turned)
    pulses = [1000.0 + 0.5 * step for step in range(2001)] + [1500.0 - 1e-9, 1500.0 + 1e-9]
    for pulse in pulses:
        assert thruster_force(vehicle, thruster, pulse, 13.0) == pytest.approx(stack.force(pulse), abs=1e-9), pulse


def test_thrust_goes_with_a_power_of_the_supply() -> None:
    assert steady_force(replace(CURVE, supply_exponent=2.0), 1900, 7.4) == pytest.approx(15.528 / 4, abs=1e-3)


def test_sign_pattern_of_the_paper() -> None:
    rows = [wrench_per_newton(VEHICLE, one) for one in VEHICLE.thrusters]
    # COB-2023-1394: surge by T1 and T2, sway by T1 and T3, each free of yaw.
    assert rows[0][0] + rows[1][0] == pytest.approx(2 * math.cos(math.radians(55)))
    assert rows[0][5] + rows[1][5] == pytest.approx(0.0, abs=1e-12)
    assert rows[0][1] + rows[2][1] == pytest.approx(2 * math.sin(math.radians(55)))
    assert rows[0][5] + rows[2][5] == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.matrix_rank(np.array(rows)) == 6


def test_thrust_lags_and_a_failed_thruster_fades() -> None:
    plant = deep(neutral())
    plant.drive([1700, 1700, 1500, 1500, 1500, 1500, 1500, 1500])
    full = 2 * math.cos(math.radians(55)) * 8.1543
    run(plant, 0.15, 0.001)
    assert plant.thrust[0] == pytest.approx(full * (1 - math.exp(-1)), rel=1e-3)
    plant.scale_thrusters([0.0, 1, 1, 1, 1, 1, 1, 1])
    run(plant, 3.0, 0.001)
    assert plant.thrust[0] == pytest.approx(full / 2, rel=1e-3)
    assert plant.targets_N[0] == 0.0


def test_thrusters_may_have_different_lags() -> None:
    thrusters = (replace(VEHICLE.thrusters[0], lag_s=0.0), *VEHICLE.thrusters[1:])
    plant = deep(neutral(replace(VEHICLE, thrusters=thrusters)))
    plant.drive([1700, 1700, 1500, 1500, 1500, 1500, 1500, 1500])
    run(plant, 0.15, 0.001)
    wanted = math.cos(math.radians(55)) * 8.1543 * (2 - math.exp(-1))
    assert plant.thrust[0] == pytest.approx(wanted, rel=1e-3)
