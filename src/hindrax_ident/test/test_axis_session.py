"""One axis of a session: what its estimator hears of each event, what is reported, and what is kept for the fit."""

import copy
import math

import numpy as np
import pytest

from hindrax_core.readings import Vec6
from hindrax_core.signals import NAN, Supply, Thrust
from hindrax_core.text.coded import Coded
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.coriolis import Masses, VelocityHistory
from hindrax_ident.model.model_parameters import Prior, wide_prior
from hindrax_ident.model.motion_model import MOTIONS, Model, model_of, unit_wrench
from hindrax_ident.online.axis_estimator import AxisEstimator
from hindrax_ident.online.axis_session import AxisSession
from hindrax_ident.online.sample_verdict import LEARNED, NotLearned, SampleVerdict, not_learned
from hindrax_ident.records.axis_record import Series, Stretch, about_samples, between_samples
from hindrax_ident.tuning import Tuning

LEVEL = (0.0, 0.0, 0.0)
MASSES = Masses((27.3, 34.65, 37.7, 0.7, 0.9, 0.8), (0.2, 10.0, 12.0, 0.3, 0.3, 0.3))
UNSAID = (NAN, NAN, NAN)
Received = tuple[str, float, float]


def at(moment: float) -> Coded[NotLearned]:
    """A refusal that is told from others by its number."""
    return not_learned(NotLearned.PHASE, phase=moment)


class Estimator(AxisEstimator):
    """Keeps what it hears, and learns of it all the same."""

    def __init__(self, model: Model, prior: Prior) -> None:
        super().__init__(model, 0.15, prior, Tuning())
        self.received: list[Received] = []
        self.efforts: list[float | None] = []
        self.refusals: list[tuple[Coded[NotLearned], bool]] = []

    def thrust(self, t_s: float, force: float, effort: float | None = None) -> None:
        self.received.append(("thrust", t_s, force))
        self.efforts.append(effort)
        super().thrust(t_s, force, effort)

    def known(self, t_s: float, force: float) -> None:
        self.received.append(("known", t_s, force))
        super().known(t_s, force)

    def position(self, t_s: float, position: float) -> None:
        self.received.append(("position", t_s, position))
        super().position(t_s, position)

    def velocity(
        self, t_s: float, v: float, refusal: Coded[NotLearned] = LEARNED, *, derived: bool = False
    ) -> SampleVerdict:
        self.received.append(("velocity", t_s, v))
        self.refusals.append((refusal, derived))
        return super().velocity(t_s, v, refusal, derived=derived)

    def of(self, kind: str) -> list[tuple[float, float]]:
        return [(t_s, value) for one, t_s, value in self.received if one == kind]


def begun(vehicle: Vehicle, axis: int, tuning: Tuning | None = None) -> tuple[AxisSession, Estimator]:
    model = model_of(vehicle, axis)
    session = AxisSession(vehicle, model, wide_prior(vehicle, model), tuning or Tuning())
    session.estimator = estimator = Estimator(model, session.prior)
    return session, estimator


def points(series: Series) -> list[tuple[float, float]]:
    return list(zip(series.t.tolist(), series.y.tolist(), strict=True))


def kept(session: AxisSession) -> Array:
    """Velocities of the record, (n, 2)."""
    velocity = session.record((), MASSES).velocity
    return array(np.stack([velocity.t, velocity.y], axis=1))


def test_a_copy_of_a_session_shares_what_it_recorded_and_records_apart(vehicle: Vehicle) -> None:
    """The identifier copies a session of hours in one turn, and every part of a sample would cost time."""
    session, _ = begun(vehicle, 0)
    for k in range(30):
        session.thrust(0.1 * k, Thrust((10.0, 0.0, 0.0, 0.0, 0.0, 0.0), (1.0,) * len(vehicle.thrusters)))
        session.attitude(0.1 * k, LEVEL, NAN)
        session.velocity(0.1 * k, 0.01 * k, "dvl")
        session.motion(0.1 * k, (0.0, 0.01 * k, 0.0, 0.0, 0.0, 0.0), MASSES)
    judged = copy.deepcopy(session)
    for name in ("_thrusts", "_hydrostatics", "_other_velocities"):
        own, copied = (getattr(one, name) for one in (session, judged))
        assert len(own) >= 29
        assert all(a is b for a, b in zip(own, copied, strict=True))
    assert judged._velocities["dvl"][0] is session._velocities["dvl"][0]
    before = session.record((), MASSES)
    session.thrust(3.0, Thrust((20.0, 0.0, 0.0, 0.0, 0.0, 0.0), (1.0,) * len(vehicle.thrusters)))
    session.velocity(3.0, 0.3, "dvl")
    found, now = judged.record((), MASSES), session.record((), MASSES)
    assert points(found.thrust) == points(before.thrust) != points(now.thrust)
    assert points(found.velocity) == points(before.velocity) != points(now.velocity)


@pytest.mark.parametrize("axis", range(6))
def test_a_new_axis_has_nothing(vehicle: Vehicle, axis: int) -> None:
    session, _ = begun(vehicle, axis)
    record = session.record((Stretch(0.2, 0.8),), MASSES)
    empty = (record.velocity, record.thrust, record.known, record.position, record.effort, record.forces)
    assert all(len(one) == 0 for one in empty)
    assert (record.coriolis.t.tolist(), record.coriolis.y.tolist()) == ([0.0], [0.0])
    assert record.coriolis_errors == ()
    assert (record.stretches, record.plateaus) == ((), (Stretch(0.2, 0.8),))
    assert record.lag_s == session.lag_s > 0.0
    assert record.prior_delays_s == (session.lag_s, 0.05)


def test_thrust_of_its_axis_counts_with_what_each_thruster_did(vehicle: Vehicle) -> None:
    session, estimator = begun(vehicle, 5)
    forces = [tuple(float(n + k) for n in range(-4, 4)) for k in (0, 3)]
    for k, own in enumerate(forces):
        session.thrust(1.0 + k, Thrust((9.0, 8.0, 7.0, 6.0, 5.0, 2.0 + k), own))
    record = session.record((), MASSES)
    assert estimator.of("thrust") == points(record.thrust) == [(1.0, 2.0), (2.0, 3.0)]
    per_newton = np.array([unit_wrench(vehicle, one)[5] for one in vehicle.thrusters])
    assert record.effort.t.tolist() == record.forces.t.tolist() == [1.0, 2.0]
    assert record.effort.y == pytest.approx([float(np.sum((per_newton * own) ** 2)) for own in forces])
    assert estimator.efforts == pytest.approx(record.effort.y.tolist())
    assert record.forces.per_newton == pytest.approx(per_newton)
    assert record.forces.y.tolist() == [list(own) for own in forces]
    inflow = [float(np.sum(per_newton**2 * np.sqrt(np.abs(own)))) for own in forces]
    assert record.forces.inflow(record.forces.t, 0.0) == pytest.approx(inflow)
    session.thrust(3.0, Thrust((0.0,) * 6, (1.0,) * 7))
    unknown = session.record((), MASSES)
    assert len(unknown.thrust) == 3
    assert estimator.efforts[2] is None
    session.thrust(4.0, Thrust((1e300,) * 6, (1e300,) * 8))
    assert estimator.efforts[3] == math.inf
    assert len(unknown.effort) == len(unknown.forces) == 0


@pytest.mark.parametrize("less", [Supply.ASSUMED, Supply.AT_REST])
@pytest.mark.parametrize(
    ("less_s", "acts"), [((), False), ((1.5,), True), ((2.0,), True), ((2.5,), False), ((3.5,), True)]
)
def test_the_supply_is_known_as_that_of_the_least_known_thrust_of_the_stretches(
    vehicle: Vehicle, less_s: tuple[float, ...], less: Supply, *, acts: bool
) -> None:
    session, _ = begun(vehicle, 5)
    for t_s in (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0):
        session.thrust(t_s, Thrust((1.0,) * 6, (), less if t_s in less_s else Supply.MEASURED))
    flown = (Stretch(1.0, 2.0), Stretch(3.0, 4.0))
    assert session.supply(flown) is (less if acts else Supply.MEASURED)
    assert session.supply(()) is Supply.ASSUMED
    assert session.supply((Stretch(0.0, 0.5),)) is Supply.ASSUMED, "no thrust, nothing measured"


@pytest.mark.parametrize("known", Supply)
def test_the_thrust_in_force_as_a_stretch_begins_counts(vehicle: Vehicle, known: Supply) -> None:
    session, _ = begun(vehicle, 5)
    session.thrust(1.0, Thrust((1.0,) * 6, (), known))
    session.thrust(2.5, Thrust((1.0,) * 6, (), Supply.MEASURED))
    assert session.supply((Stretch(2.0, 3.0),)) is known


@pytest.mark.parametrize(
    ("axis", "force"),
    [
        # Heavier than water by 0.15 N: what sinks pulls ahead with the nose down, and to starboard with a roll to it.
        (0, lambda sinking_N, _roll, pitch: -sinking_N * math.sin(pitch)),
        (1, lambda sinking_N, roll, pitch: sinking_N * math.cos(pitch) * math.sin(roll)),
    ],
)
def test_a_tilt_and_the_motion_of_the_other_axes_are_known_forces(vehicle: Vehicle, axis: int, force: object) -> None:
    session, estimator = begun(vehicle, axis)
    assert callable(force)
    hydrostatic = force(-vehicle.net_buoyancy_N, 0.2, -0.1)
    assert session.attitude(1.0, (0.2, -0.1, 2.0), 1.5) == []
    nu = (0.3, -0.2, 0.1, 0.4, 0.5, -0.6)
    session.motion(2.0, nu, MASSES)
    m = MASSES.values
    coriolis = (m[1] * -0.2 * -0.6 - m[2] * 0.1 * 0.5, m[2] * 0.1 * 0.4 - m[0] * 0.3 * -0.6)[axis]
    later = force(-vehicle.net_buoyancy_N, -0.3, 0.2)
    session.attitude(3.0, (-0.3, 0.2, NAN), NAN)
    known = [(1.0, hydrostatic), (2.0, hydrostatic + coriolis), (3.0, later + coriolis)]
    assert [t for t, _ in estimator.of("known")] == [t for t, _ in known]
    assert [one for _, one in estimator.of("known")] == pytest.approx([one for _, one in known])
    for unsaid in ((NAN, 0.1, 0.0), (0.1, NAN, 0.0), UNSAID):
        session.attitude(4.0, unsaid, 1.0)
    record = session.record((), MASSES)
    assert len(estimator.of("known")) == 3
    assert record.known.t.tolist() == [1.0, 3.0]
    assert record.known.y == pytest.approx([hydrostatic, later])
    assert record.coriolis.t.tolist() == [2.0]
    assert record.coriolis.y == pytest.approx([coriolis])
    # Masses of sway and heave, or of surge and heave, are uncertain; each has its own column.
    assert len(record.coriolis_errors) == (2, 1)[axis]
    assert len(record.position) == 0
    assert estimator.of("position") == []


@pytest.mark.parametrize("axis", range(2, 6))
def test_hydrostatics_of_the_other_axes_are_in_their_models(vehicle: Vehicle, axis: int) -> None:
    session, estimator = begun(vehicle, axis)
    session.attitude(1.0, (0.2, -0.1, 2.0), NAN)
    assert estimator.of("known") == []
    assert len(session.record((), MASSES).known) == 0


@pytest.mark.parametrize("axis", range(6))
def test_a_motion_along_its_own_axis_alone_is_no_news(vehicle: Vehicle, axis: int) -> None:
    session, estimator = begun(vehicle, axis)

    def nu(own: float, others: float) -> Vec6:
        six = [others] * 6
        six[axis] = own
        return (six[0], six[1], six[2], six[3], six[4], six[5])

    for t_s, own, others in ((1.0, 0.4, 0.0), (2.0, 0.4, 0.2), (3.0, 0.5, 0.2), (4.0, 0.5, 0.3)):
        session.motion(t_s, nu(own, others), MASSES)
    assert [t for t, _ in estimator.of("known")] == [2.0, 4.0]
    record = session.record((), MASSES)
    assert record.coriolis.t.tolist() == [1.0, 2.0, 3.0, 4.0], "what stays as it was has been measured, too"
    assert record.coriolis.y[1] == record.coriolis.y[2]
    # Its own velocity has no part in it.
    still = begun(vehicle, axis)[0]
    still.motion(2.0, nu(0.0, 0.2), MASSES)
    assert still.record((), MASSES).coriolis.y[0] == pytest.approx(float(record.coriolis.y[1]))


def test_forces_by_motion_across_are_those_of_their_time_and_not_of_the_sample_before(vehicle: Vehicle) -> None:
    """A DVL that measures three times a second beside a gyroscope: in between, speed goes on as it went."""
    session, _ = begun(vehicle, 1)
    history = VelocityHistory(1.0)
    for k in range(200):
        t_s = 0.02 * k
        u = 0.2 * t_s if k % 16 == 0 else NAN
        history.update(t_s, (u, NAN, NAN, NAN, NAN, 0.3))
        session.motion(t_s, history.at(t_s), MASSES, history.measured_at(t_s))
    record = session.record((), MASSES)
    at_s = array(np.linspace(0.5, 3.5, 7))
    force = -MASSES.values[0] * 0.2 * at_s * 0.3
    assert about_samples(record.coriolis).force(at_s) == pytest.approx(force, abs=0.011 * MASSES.values[0] * 0.2 * 0.3)
    # Its impulse between any two samples is that of straight lines.
    wanted = -MASSES.values[0] * 0.2 * 0.3 * 0.5 * (3.0**2 - 1.0**2)
    assert float(np.diff(record.known_impulse(array(np.array([1.0, 3.0]))))[0]) == pytest.approx(wanted)


def test_a_pause_between_samples_is_no_line() -> None:
    t = array(np.arange(10.0))
    sparse = array(np.array([NAN, 2.0, NAN, 4.0, NAN, NAN, NAN, NAN, 1.0, NAN]))
    assert between_samples(t, sparse, 2.0).tolist() == [0.0, 2.0, 3.0, 4.0, 4.0, 4.0, 0.0, 0.0, 1.0, 1.0]
    assert between_samples(t, array(np.full(10, NAN)), 2.0).tolist() == [0.0] * 10


def test_fast_velocities_are_averaged_and_only_one_source_counts(vehicle: Vehicle) -> None:
    session, estimator = begun(vehicle, 5, Tuning(bin_s=0.02))
    inputs = [
        (1.0, 0.1, "navigation"),
        (1.01, 0.3, "navigation"),
        (1.02, 0.5, "navigation"),
        (1.03, NAN, "icm20948"),
        (1.03, 0.9, "icm20948"),
        (1.04, 9.0, "navigation"),
        (1.05, 0.2, "icm20948"),
        (1.06, 0.4, "icm20948"),
        (1.07, 0.2, "icm20948"),
    ]
    verdicts = [session.velocity(t_s, v, source, at(t_s)) for t_s, v, source in inputs]
    # The bin of the navigator goes to the source that completes it.
    assert [len(one) for one in verdicts] == [0, 0, 1, 0, 0, 0, 1, 0, 1]
    assert estimator.of("velocity") == [pytest.approx(one) for one in ((1.005, 0.2), (1.025, 0.7), (1.055, 0.3))]
    assert [one[0][0] for one in verdicts if one] == pytest.approx([1.005, 1.025, 1.055])
    assert estimator.refusals == [(at(1.02), False), (at(1.05), False), (at(1.07), False)]
    assert kept(session) == pytest.approx(np.array([[1.025, 0.7], [1.055, 0.3]]))


@pytest.mark.parametrize(("axis", "index"), [(3, 0), (4, 1)])
def test_angles_restore_roll_and_pitch_and_are_kept_twice_a_second(vehicle: Vehicle, axis: int, index: int) -> None:
    session, estimator = begun(vehicle, axis)
    for k in range(12):
        angles = [0.7, 0.8, 0.9]
        angles[index] = 0.1 * k
        assert session.attitude(0.125 * k, (angles[0], angles[1], angles[2]), 1.0) == []
    other = [NAN, 0.1, 0.2]
    for unsaid in (UNSAID, tuple(other if index == 0 else [0.1, NAN, 0.2])):
        session.attitude(2.0, (unsaid[0], unsaid[1], unsaid[2]), 1.0)
    assert np.array(estimator.of("position")) == pytest.approx(np.array([(0.125 * k, 0.1 * k) for k in range(12)]))
    position = session.record((), MASSES).position
    assert position.t.tolist() == [0.0, 0.5, 1.0]
    assert position.y == pytest.approx([0.0, 0.4, 0.8])
    session.attitude(2.0, (0.3, 0.3, NAN), NAN)
    assert len(session.record((), MASSES).position) == 4


def test_yaw_has_no_position(vehicle: Vehicle) -> None:
    session, estimator = begun(vehicle, 5)
    assert session.attitude(1.0, (0.1, 0.2, 0.3), 1.5) == []
    assert estimator.received == []


def depths(
    session: AxisSession, first_s: float, count: int, attitude: tuple[float, float, float] = UNSAID
) -> list[float]:
    """Depths at 20 Hz, sinking at 0.2 m/s, and the times of the velocities that were learned from."""
    out = []
    for k in range(count):
        t_s = first_s + 0.05 * k
        out += [at_s for at_s, _ in session.attitude(t_s, attitude, 1.0 + 0.2 * t_s, at(k))]
    return out


def test_depths_give_the_velocity_of_heave_where_no_instrument_does(vehicle: Vehicle) -> None:
    session, estimator = begun(vehicle, 2)
    assert [len(session.velocity(t_s, 5.0, "navigation")) for t_s in (0.8, 0.9)] == [0, 1]
    assert len(kept(session)) == 1
    estimator.received.clear()
    estimator.refusals.clear()
    at_s = depths(session, 1.0, 9)
    # Means of two depths each, over 0.1 s: at 1.025, 1.125 and so on; their differences lie between them.
    assert at_s == pytest.approx([1.075, 1.175, 1.275])
    assert [t for t, _ in estimator.of("velocity")] == pytest.approx(at_s)
    assert [v for _, v in estimator.of("velocity")] == pytest.approx([0.2] * 3)
    assert estimator.refusals == [(at(4), True), (at(6), True), (at(8), True)]
    assert len(estimator.of("position")) == 9
    assert len(session.record((), MASSES).position) == 9
    assert [session.velocity(2.0 + 0.1 * k, 5.0, "navigation") for k in range(3)] == [[]] * 3
    assert len(kept(session)) == 0
    assert session.attitude(2.0, UNSAID, NAN) == []
    assert len(estimator.of("position")) == 9


@pytest.mark.parametrize(("pause_s", "goes_on"), [(0.2, True), (0.47, True), (0.48, False)])
def test_mean_depths_more_than_half_a_second_apart_give_no_velocity(
    vehicle: Vehicle, pause_s: float, goes_on: bool
) -> None:
    session, estimator = begun(vehicle, 2)
    depths(session, 1.0, 3)  # a mean at 1.025, and a depth at 1.1
    across_s = 0.5 * (1.1 + 1.1 + pause_s + 0.025)
    assert depths(session, 1.1 + pause_s, 5) == pytest.approx([1.0625, *[across_s] * goes_on, 1.1 + pause_s + 0.075])
    assert [v for _, v in estimator.of("velocity")] == pytest.approx([0.2] * (2 + goes_on))


def test_an_instrument_of_heave_replaces_the_velocity_of_the_depths(vehicle: Vehicle) -> None:
    session, estimator = begun(vehicle, 2)
    depths(session, 1.0, 5)
    assert len(estimator.of("velocity")) == 1
    session.velocity(1.3, 0.25, "dvl75")
    session.velocity(1.4, 0.25, "dvl75")
    assert depths(session, 1.5, 5) == []
    assert kept(session) == pytest.approx(np.array([[1.3, 0.25]]))
    assert len(estimator.of("position")) == 10


def test_depths_of_a_sensor_count_before_those_of_a_navigator(vehicle: Vehicle) -> None:
    session, estimator = begun(vehicle, 2)
    session.attitude(1.0, LEVEL, 9.0)
    session.attitude(1.01, UNSAID, 1.5)
    session.attitude(1.02, LEVEL, 9.0)
    assert estimator.of("position") == [(1.0, 9.0), (1.01, 1.5)]
    assert points(session.record((), MASSES).position) == [(1.01, 1.5)]


@pytest.mark.parametrize("axis", [0, 1, 3, 5])
def test_depths_are_nothing_to_the_other_axes(vehicle: Vehicle, axis: int) -> None:
    session, estimator = begun(vehicle, axis)
    depths(session, 1.0, 9)
    assert [one for one in estimator.received if one[0] in ("position", "velocity")] == []
    assert session.velocity(2.0, 0.1, "navigation") == []
    assert len(session.velocity(2.1, 0.1, "navigation")) == 1
    assert len(kept(session)) == 1


@pytest.mark.parametrize(("motion", "rows"), [("heave_down", (0, 1, 4)), ("heave_up", (2, 3, 4))])
def test_an_estimate_is_that_of_its_direction_and_without_the_mass_of_the_body(
    vehicle: Vehicle, motion: str, rows: tuple[int, ...]
) -> None:
    session, estimator = begun(vehicle, 2)
    estimator.regression.rate = 1.7
    reported = session.estimate(MOTIONS[motion], SampleVerdict(not_learned(NotLearned.OUTLIER), 0.02))
    values, sigmas = session.prior.values, session.prior.sigmas
    assert reported.motion == motion
    assert reported.names == ("k_q", "k_l", "b", "added_mass")
    assert reported.units == ("N s^2/m^2", "N s/m", "N", "kg")
    assert reported.values == pytest.approx([*values[list(rows)], values[-1] - vehicle.mass_kg], rel=1e-6)
    assert np.shape(reported.covariance) == (4, 4)
    assert np.sqrt(np.diag(reported.covariance))[-1] == pytest.approx(sigmas[-1], rel=0.01)
    assert (reported.samples, reported.effective_samples) == (0, 0.0)
    assert (reported.learning, reported.reason) == (False, not_learned(NotLearned.OUTLIER))
    # An innovation of the velocity is a force as far as the filter remembers it: over its time, on the mass.
    assert reported.innovation == pytest.approx(0.02 * 1.7 * values[-1], rel=1e-6)


def test_a_reported_value_is_within_its_bounds(vehicle: Vehicle) -> None:
    model = model_of(vehicle, 0)
    prior = Prior(np.array([-4.0, 3.0, 0.0, 14.0]), np.array([2.0, 1.0, 1.0, 5.0]))
    session = AxisSession(vehicle, model, prior, Tuning())
    reported = session.estimate(MOTIONS["surge"], SampleVerdict())
    assert reported.values[0] == 0.0
    assert reported.values[3] == pytest.approx(0.0, abs=1e-9)
    assert reported.learning
    assert session.estimator.estimate()[0][0] == pytest.approx(-4.0)
