"""Commissioning: pulses behind their guards, and the inference from answers to wirings and lines of YAML."""

import math
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from hindrax_control.allocation.effectiveness import Matrix, effectiveness
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.commissioning.commissioning import Commissioning
from hindrax_control.commissioning.dead_bands import QUARTER_S, YAW, DeadBandLadder
from hindrax_control.commissioning.findings import MEASURED, OPEN, PROVEN, WRONG, Finding, Findings, Mend, mended
from hindrax_control.commissioning.hypotheses import RIGHT_TURNS, Wiring, angles_deg, explain, turn_of
from hindrax_control.commissioning.picture import BAD, svg
from hindrax_control.commissioning.probes import body_pulses, probe_N, single_pulses
from hindrax_control.commissioning.record import NotProven, UNPROVEN_mps, geometry_hash, slowed, unproven
from hindrax_control.commissioning.response import Answer, Prior
from hindrax_control.maneuver.goal import MOST_PULSE_N, Goal, Pulse, require_flyable
from hindrax_control.maneuver.pulses import CALM_PATIENCE_S, CALM_S, PulseManeuver, believed
from hindrax_control.pilot import Pilot
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Battery, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading
from hindrax_core.rotation import matrix
from hindrax_core.sensor_table import Capability
from hindrax_core.signals import Navigation
from hindrax_core.text.refusals import Reason, found
from hindrax_core.vehicle import Commissioned, Vehicle, load_vehicle

VEHICLES = Path(__file__).parents[2] / "hindrax_bringup" / "vehicles"
HINDRAX = load_vehicle(VEHICLES / "hindrax.yaml")
EVERY = tuple(load_vehicle(path) for path in sorted(VEHICLES.glob("*.yaml")))
AGES = dict.fromkeys((name for vehicle in EVERY for name in vehicle.sensors), 0.0)
QUIET = Navigation(
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    0.3,
    1.5,
    (0.0, 0.0),
    dvl_locked=True,
    ages_s=AGES,
    depth_age_s=0.0,
)
by_vehicle = pytest.mark.parametrize("vehicle", EVERY, ids=lambda one: one.name)


def flown(
    maneuver: PulseManeuver, navigation: Navigation, seconds: float, start_s: float = 10.0
) -> list[tuple[float, ...]]:
    """Forces of every cycle."""
    found = []
    for cycle in range(round(seconds * 50.0)):
        output = maneuver.step(navigation, stamp_from_s(start_s + 0.02 * cycle))
        found.append(output.forces_N)
        if output.done:
            break
    return found


@by_vehicle
def test_each_thruster_runs_alone_and_within_its_limit(vehicle: Vehicle) -> None:
    goal = Goal((), pulses=single_pulses(vehicle, effectiveness(vehicle)))
    require_flyable(goal, vehicle)
    forces = flown(PulseManeuver(vehicle, goal), QUIET, 200.0)
    running = [tuple(np.flatnonzero(one)) for one in forces if any(one)]
    assert all(len(one) == 1 for one in running)
    assert [one for (one,) in dict.fromkeys(running)] == list(range(len(vehicle.thrusters)))
    assert float(np.max(np.abs(forces))) <= MOST_PULSE_N
    assert forces[-1] == (0.0,) * len(vehicle.thrusters)


def test_the_motion_is_named_while_it_is_flown_and_not_at_its_end() -> None:
    maneuver = PulseManeuver(HINDRAX, Goal((), pulses=(Pulse((2.0, *(0.0,) * 7), 0.1),)))
    outputs = [maneuver.step(QUIET, stamp_from_s(10.0 + 0.02 * cycle)) for cycle in range(40)]
    assert [name for name, _ in groupby(output.phase.motion for output in outputs)] == ["commission", ""]
    assert [name for name, _ in groupby(output.phase.phase for output in outputs)] == ["settle", "excite", "done"]


@by_vehicle
def test_forth_and_back_are_the_same(vehicle: Vehicle) -> None:
    for index, force_N in enumerate(probe_N(vehicle, effectiveness(vehicle))):
        mine = [one for one in single_pulses(vehicle, effectiveness(vehicle)) if one.forces_N[index]]
        assert sum(one.forces_N[index] * one.seconds for one in mine) == pytest.approx(0.0)
        assert max(one.forces_N[index] for one in mine) == force_N


@by_vehicle
def test_body_pulses_hardly_tilt_a_vehicle_at_rest(vehicle: Vehicle) -> None:
    B, prior = effectiveness(vehicle), Prior(vehicle)
    pulses = body_pulses(vehicle, B)
    require_flyable(Goal((), pulses=pulses), vehicle)
    for pulse in pulses:
        moments = (B @ np.array(pulse.forces_N))[3:5]
        assert np.all(np.abs(moments) <= np.maximum(prior.restoring[3:5], 0.3) * math.radians(6.5))


def test_a_body_with_dead_thrusters_is_moved_by_the_others() -> None:
    B = effectiveness(HINDRAX)
    B[:, [0, 5]] = 0.0
    forces = [pulse.forces_N for pulse in body_pulses(HINDRAX, B)]
    assert forces
    assert not any(one[0] or one[5] for one in forces)


@by_vehicle
def test_a_vehicle_that_sank_is_brought_up_again_before_anything_else(vehicle: Vehicle) -> None:
    B, rest = effectiveness(vehicle), body_pulses(vehicle, effectiveness(vehicle))
    upward = {}
    for sunk_m in (0.1, 0.5, 1.0):
        pulses = body_pulses(vehicle, B, sunk_m=sunk_m)
        require_flyable(Goal((), pulses=pulses), vehicle)
        upward[sunk_m] = -sum(float(B[2] @ np.array(one.forces_N)) * one.seconds for one in pulses)
    once = max(abs(float(B[2] @ np.array(one.forces_N))) * one.seconds for one in rest)
    assert upward[0.1] == pytest.approx(0.0, abs=0.05)
    assert upward[0.5] >= 3 * 0.9 * once, "0.3 m by pushes of 0.12 m"
    assert upward[1.0] >= 7 * 0.9 * once
    assert float(B[2] @ np.array(pulses[0].forces_N)) < 0.0


def as_claimed(vehicle: Vehicle) -> Commissioning:
    """Commissioning whose thrusters were all found to push as claimed."""
    work = Commissioning(vehicle)
    work._round = 2
    work.wirings = tuple(Wiring(index, 1, 1.0, likelihood=1.0) for index in range(len(vehicle.thrusters)))
    work.answers = dict.fromkeys(range(len(vehicle.thrusters)), Answer(np.zeros(6), np.ones(6), 0.0))
    return work


TILTED = found(Reason.COMMISSION, "tilted by 20 deg from rest")


def test_what_tilted_the_vehicle_is_tried_once_more_at_half_the_lean() -> None:
    work, B = as_claimed(HINDRAX), effectiveness(HINDRAX)
    gentle = work.gentler(stamp_from_s(50.0), TILTED)
    assert gentle is not None
    lean, before = (
        max(float(np.max(np.abs(B[3:5] @ np.array(pulse.forces_N)))) for pulse in pulses)
        for pulses in (gentle, body_pulses(HINDRAX, B))
    )
    assert 0.0 < lean < 0.6 * before
    assert work.gentler(stamp_from_s(90.0), TILTED) is None


def test_motions_that_left_a_sensor_open_are_flown_once_more() -> None:
    work = as_claimed(HINDRAX)
    assert work.next_pulses(stamp_from_s(91.0)) == body_pulses(HINDRAX, effectiveness(HINDRAX)), "nothing was turned"
    rung = work.next_pulses(stamp_from_s(120.0))
    assert rung is not None
    assert len(rung) == 3, "the dead bands come last"
    assert work.next_pulses(stamp_from_s(130.0)) is None, "nothing was turned"
    ended, swapped = as_claimed(HINDRAX), as_claimed(HINDRAX)
    ended.ended = "stopped"
    swapped.wirings = (replace(swapped.wirings[0], sign=-1), *swapped.wirings[1:])
    assert ended.next_pulses(stamp_from_s(91.0)) is None
    assert swapped.next_pulses(stamp_from_s(91.0)) is None


def test_single_pulses_that_tilted_the_vehicle_go_on_at_half_the_force_from_the_thruster_at_work() -> None:
    work, usual = Commissioning(HINDRAX), single_pulses(HINDRAX, effectiveness(HINDRAX))
    work._round, count = 1, len(HINDRAX.thrusters)
    for index in range(3):
        for tick in range(30):
            forces = tuple(2.0 * (at == index) for at in range(count))
            work.on_forces(stamp_from_s(10.0 + 3.0 * index + 0.02 * tick), forces)
            work.on_forces(stamp_from_s(10.0 + 3.0 * index + 0.7), (0.0,) * count)
    assert work.gentler(stamp_from_s(17.0), found(Reason.LEAK, "water in the hull")) is None
    left = work.gentler(stamp_from_s(17.0), TILTED)
    assert left is not None
    assert [np.flatnonzero(one.forces_N)[0] for one in left[::3]] == [2, 3, 4, 5, 6, 7]
    assert all(abs(sum(one.forces_N)) < abs(sum(before.forces_N)) for one, before in zip(left, usual[6:], strict=True))
    for tick in range(20):
        work.on_forces(stamp_from_s(20.0 + 0.02 * tick), tuple(1.0 * (at == 2) for at in range(count)))
    windows = dict(work._windows())
    assert windows[1].begin_s < 13.1
    assert windows[2].begin_s > 18.0, "the last attempt counts"
    assert work.gentler(stamp_from_s(25.0), TILTED) is None, "once"


def test_a_thruster_that_explains_nothing_surely_is_pulsed_once_more() -> None:
    work, usual = as_claimed(HINDRAX), single_pulses(HINDRAX, effectiveness(HINDRAX))
    sure = work.wirings
    verdicts = [(*sure[:6], replace(sure[6], likelihood=0.77), sure[7])] * 2
    judged = iter(verdicts)

    def judge() -> None:
        work.wirings = next(judged)

    work._round, work._judge_thrusters = 1, judge  # type: ignore[method-assign]  # what the water showed
    assert work.next_pulses(stamp_from_s(30.0)) == usual[18:21]
    assert work.next_pulses(stamp_from_s(34.0)) == body_pulses(HINDRAX, effectiveness(HINDRAX)), "once"
    for begin_s, index in ((10.0, 6), (12.0, 7), (30.0, 6)):
        for tick in range(20):
            forces = tuple(2.0 * (at == index) for at in range(len(HINDRAX.thrusters)))
            work.on_forces(stamp_from_s(begin_s + 0.02 * tick), forces)
    assert dict(work._windows())[6].begin_s > 29.0
    work._round = 1
    left = work.gentler(stamp_from_s(31.0), TILTED)
    assert left is not None
    assert [np.flatnonzero(one.forces_N)[0] for one in left[::3]] == [6, 7], "from the one that was at work"


def field_of(turned: Matrix, drift_radps: float) -> Finding:
    """What is said of a magnetometer that is turned, in a vehicle that turned slowly while it rested."""
    work, (source, *_) = as_claimed(HINDRAX), HINDRAX.measuring("rates")
    mount, count = turn_of(HINDRAX.sensors[source].rotation_deg), len(HINDRAX.thrusters)
    earth_T = np.array([17.5e-6, 3.0e-6, -13.8e-6])
    for tick in range(5000):
        at_s = 0.01 * tick
        # Forth and back by 17 degrees, from 12 to 15 s.
        turn_radps = 2.0 * math.pi / 3.0
        phase_rad = turn_radps * min(max(at_s - 12.0, 0.0), 3.0)
        yaw_rad = drift_radps * at_s + 0.15 * (1.0 - math.cos(phase_rad))
        rates = mount.T @ np.array([0.0, 0.0, drift_radps + 0.15 * turn_radps * math.sin(phase_rad)])
        force = mount.T @ np.array([0.0, 0.0, -GRAVITY_mps2])
        body_T = np.array(matrix((0.0, 0.0, yaw_rad))).T @ earth_T
        stamp = stamp_from_s(at_s)
        work.on_reading(source, Stamped(stamp, Inertial(tuple(force.tolist()), tuple(rates.tolist()), 20.0)))
        if tick % 4 == 0:
            work.on_reading(source, Stamped(stamp, Magnetic(tuple((mount.T @ turned @ body_T).tolist()))))
    work.rest(stamp_from_s(0.0), stamp_from_s(3.0))
    for tick in range(350):
        work.on_forces(stamp_from_s(11.0 + 0.1 * tick), (1.0, 1.0, *(0.0,) * (count - 2)))
    (row,) = [one for one in work.finalize().rows if one.claim == f"{source} magnetometer"]
    return row


@pytest.mark.parametrize("drift_radps", [0.0, math.radians(0.7)])
def test_a_slow_turn_while_the_gyroscope_is_set_to_zero_is_no_fault_of_the_magnetometer(drift_radps: float) -> None:
    assert field_of(np.eye(3), drift_radps).verdict == PROVEN
    assert field_of(np.diag((1.0, -1.0, -1.0)), drift_radps).verdict == WRONG, "upside down"


def test_nothing_is_tried_again_where_a_thruster_is_not_as_claimed_or_another_guard_ended_it() -> None:
    reversed_one = as_claimed(HINDRAX)
    reversed_one.wirings = (replace(reversed_one.wirings[0], sign=-1), *reversed_one.wirings[1:])
    assert reversed_one.gentler(stamp_from_s(50.0), TILTED) is None
    assert as_claimed(HINDRAX).gentler(stamp_from_s(50.0), found(Reason.LEAK, "water in the hull")) is None


def test_a_pulse_waits_for_rest_but_not_for_ever() -> None:
    goal = Goal((), pulses=(Pulse((2.0, *(0.0,) * 7), 0.5),))
    swinging = replace(QUIET, rate_radps=(0.2, 0.0, 0.0))
    forces = flown(PulseManeuver(HINDRAX, goal), swinging, 20.0)
    begin = next(at for at, one in enumerate(forces) if any(one))
    assert begin == pytest.approx(CALM_PATIENCE_S * 50.0, abs=2)


def test_a_pulse_waits_for_rest_from_the_end_of_the_one_before() -> None:
    forces = flown(PulseManeuver(HINDRAX, Goal((), pulses=(Pulse((2.0, *(0.0,) * 7), 0.5),) * 2)), QUIET, 5.0)
    lengths = [(running, len(list(cycles))) for running, cycles in groupby(map(any, forces))]
    assert [running for running, _ in lengths] == [False, True, False, True, False]
    assert [count for _, count in lengths[1:4]] == pytest.approx([25, CALM_S * 50.0, 25], abs=1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"attitude_rad": (math.radians(25.0), 0.0, 0.0)}, "commission: tilted by 25 deg"),
        ({"rate_radps": (0.0, 0.0, 2.0)}, "commission: turns at"),
        ({"attitude_rad": (math.nan, 0.0, 0.0)}, "commission: attitude or rate unknown"),
        ({"altitude_m": 0.2}, "altitude_band"),
    ],
)
def test_a_guard_ends_it_neutral(change: dict[str, object], said: str) -> None:
    maneuver = PulseManeuver(HINDRAX, Goal((), pulses=single_pulses(HINDRAX, effectiveness(HINDRAX))))
    flown(maneuver, QUIET, 1.0)
    output = maneuver.step(replace(QUIET, **change), stamp_from_s(11.0))  # type: ignore[arg-type]  # any field of it
    assert output.done
    assert output.neutral
    assert output.aborted.startswith(said)
    assert not any(output.forces_N)


@pytest.mark.parametrize("list_deg", [0.0, 5.0, 12.0, 19.0, 22.0])
def test_a_vehicle_that_lists_is_ended_neutral_before_it_tilts_to_thirty_degrees(list_deg: float) -> None:
    maneuver = PulseManeuver(HINDRAX, Goal((), pulses=single_pulses(HINDRAX, effectiveness(HINDRAX))))
    listing = replace(QUIET, attitude_rad=(math.radians(list_deg), 0.0, 0.0))
    assert any(map(any, flown(maneuver, listing, 1.0)))
    tilts = np.arange(list_deg, 30.0, 0.5)
    outputs = [
        maneuver.step(replace(QUIET, attitude_rad=(math.radians(tilt), 0.0, 0.0)), stamp_from_s(11.0 + 0.02 * at))
        for at, tilt in enumerate(tilts)
    ]
    ended = next(tilt for tilt, output in zip(tilts, outputs, strict=True) if output.done)
    assert ended == pytest.approx(min(27.5, list_deg + 20.5), abs=0.6)
    assert outputs[-1].neutral
    assert outputs[-1].aborted.startswith("commission: tilted by")


def test_a_vehicle_without_room_for_a_swing_is_not_pulsed() -> None:
    maneuver = PulseManeuver(HINDRAX, Goal((), pulses=single_pulses(HINDRAX, effectiveness(HINDRAX))))
    listing = replace(QUIET, attitude_rad=(0.0, math.radians(24.0), 0.0))
    assert not any(map(any, flown(maneuver, listing, 2.0)))
    assert maneuver.last is not None
    assert maneuver.last.aborted.startswith("commission: lists by 24 deg")


def test_what_swings_at_its_start_is_judged_by_its_rest() -> None:
    maneuver = PulseManeuver(HINDRAX, Goal((), pulses=single_pulses(HINDRAX, effectiveness(HINDRAX))))
    for cycle in range(100):
        # 26 degrees to one side, then to the other, and so on to rest.
        lean_rad = math.radians(26.0) * math.exp(-0.02 * cycle) * math.cos(0.2 * cycle)
        swinging = replace(QUIET, attitude_rad=(lean_rad, 0.0, 0.0), rate_radps=(0.2, 0.0, 0.0))
        assert not any(maneuver.step(swinging, stamp_from_s(10.0 + 0.02 * cycle)).forces_N)
    assert any(map(any, flown(maneuver, QUIET, 1.0, 12.0)))
    tilted = maneuver.step(replace(QUIET, attitude_rad=(math.radians(21.0), 0.0, 0.0)), stamp_from_s(13.0))
    assert tilted.aborted.startswith("commission: tilted by 21 deg from rest")


def at_rest(vehicle: Vehicle, list_deg: float) -> Commissioning:
    """Commissioning of a vehicle that rested with this list."""
    work, (source, *_) = Commissioning(vehicle), vehicle.measuring("rates")
    list_rad = math.radians(list_deg)
    up = turn_of(vehicle.sensors[source].rotation_deg).T @ np.array([0.0, -math.sin(list_rad), -math.cos(list_rad)])
    x, y, z = (GRAVITY_mps2 * up).tolist()
    reading = Inertial((x, y, z), (0.0, 0.0, 0.0), 20.0)
    for at in range(100):
        work.on_reading(source, Stamped(stamp_from_s(0.02 * at), reading))
    work.rest(stamp_from_s(0.0), stamp_from_s(2.0))
    return work


@by_vehicle
def test_the_further_a_vehicle_lists_the_gentler_it_is_pulsed(vehicle: Vehicle) -> None:
    usual, B = single_pulses(vehicle, effectiveness(vehicle)), effectiveness(vehicle)
    assert at_rest(vehicle, 5.0).next_pulses(stamp_from_s(2.0)) == usual
    gentler = at_rest(vehicle, 22.5).next_pulses(stamp_from_s(2.0))
    assert gentler is not None
    for one, other in zip(gentler, single_pulses(vehicle, B, share=4.5 / 8.0), strict=True):
        assert one.forces_N == pytest.approx(other.forces_N)
    lists = at_rest(vehicle, 24.0)
    assert lists.next_pulses(stamp_from_s(2.0)) is None
    rows = {row.claim: row for row in lists.finalize().rows}
    assert rows["trim at rest"].verdict == WRONG
    assert rows["trim at rest"].remedy == "trim it to 23 deg at the most: weight to port"
    mount = f"{vehicle.measuring('rates')[0]} mount"
    unproven_rows = [row for claim, row in rows.items() if claim == mount or claim.startswith("T")]
    assert {row.verdict for row in unproven_rows} == {OPEN}, "nothing was pulsed"
    assert "lag of the thrusters" not in rows


def test_a_turned_sensor_does_not_end_it() -> None:
    """An inertial sensor on its side, a position far away, no bottom lock: that is what it is to find."""
    lying = replace(QUIET, attitude_rad=(1.5, 0.0, 0.0), dvl_locked=False, position_m=(50.0, 0.0))
    maneuver = PulseManeuver(HINDRAX, Goal((), pulses=(Pulse((2.0, *(0.0,) * 7), 0.5),)))
    forces = flown(maneuver, lying, 20.0)
    assert maneuver.last is not None
    assert maneuver.last.aborted == ""
    assert any(map(any, forces))
    assert believed([found(one, "x") for one in (Reason.ATTITUDE, Reason.POOL_BOX, Reason.LEAK)]) == (
        found(Reason.LEAK, "x"),
    )


@pytest.mark.parametrize(
    ("pulse", "said"),
    [
        (Pulse((3.5, *(0.0,) * 7), 0.5), "3.5 N"),
        (Pulse((math.nan, *(0.0,) * 7), 0.5), "nan N"),
        (Pulse((1.0,), 0.5), "1 forces"),
        (Pulse((1.0, *(0.0,) * 7), 2.5), "2.5 s"),
        (Pulse((1.0, *(0.0,) * 7), math.nan), "nan s"),
    ],
)
def test_a_goal_beyond_what_is_harmless_is_refused(pulse: Pulse, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        require_flyable(Goal((), pulses=(pulse,)), HINDRAX)


def test_only_an_armed_vehicle_is_pulsed_and_no_hold_acts_meanwhile() -> None:
    pilot, goal = Pilot(HINDRAX), Goal((), pulses=(Pulse((2.0, *(0.0,) * 7), 0.5),))
    pilot.step(QUIET, stamp_from_s(10.0), armed=False)
    with pytest.raises(HindraxError, match="not armed"):
        pilot.fly(goal)
    pilot.step(QUIET, stamp_from_s(10.02), armed=True)
    pilot.fly(goal)
    outputs = [pilot.step(QUIET, stamp_from_s(10.04 + 0.02 * cycle), armed=True) for cycle in range(100)]
    assert {one.forces_N for one in outputs if any(one.forces_N)} == {goal.pulses[0].forces_N}
    assert not any(state.engaged for one in outputs for state in one.holds)
    assert not pilot.flying
    assert outputs[-1].forces_N == ()
    assert outputs[-1].wrench == (0.0,) * 6


def answer_of(column: np.ndarray[tuple[int, ...], np.dtype[np.float64]], rng: np.random.Generator) -> Answer:
    """Answer of a thruster with this column, 15 % off and with noise."""
    sigma = np.array([0.02, 0.02, 0.03, 0.003, 0.003, 0.003])
    return Answer(column * rng.normal(1.0, 0.15, 6) + rng.normal(0.0, sigma), sigma, 0.0)


@by_vehicle
def test_every_wiring_of_every_thruster_is_told(vehicle: Vehicle) -> None:
    B, rng = effectiveness(vehicle), np.random.default_rng(5)
    for index in range(B.shape[1]):
        for other in range(B.shape[1]):
            for sign in (1, -1):
                found = explain(index, answer_of(sign * B[:, other], rng), B)
                assert (found.drives, found.sign) == (other, sign)
        dead = explain(index, answer_of(np.zeros(6), rng), B)
        assert dead.drives is None


def test_there_are_24_right_turns_and_their_angles_make_them() -> None:
    assert len({tuple(map(float, turn.ravel())) for turn in RIGHT_TURNS}) == 24
    for turn in RIGHT_TURNS:
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert np.allclose(turn_of(angles_deg(turn)), turn, atol=1e-9)


def test_mends_change_the_vehicle_and_say_how() -> None:
    mends = (
        Mend(("thrusters", "T3", "reversed"), True),
        Mend(("sensors", "dvl75", "rotation_deg"), [0.0, 0.0, 90.0]),
        Mend(("water", "surface_pressure_Pa"), 100000.0),
    )
    vehicle = mended(HINDRAX, mends)
    assert vehicle.thrusters[2].reversed
    assert vehicle.sensors["dvl75"].rotation_deg == (0.0, 0.0, 90.0)
    assert vehicle.water.surface_pressure_Pa == 100000.0
    assert mends[0].line == "thrusters.T3.reversed: true"
    assert mends[1].line == "sensors.dvl75.rotation_deg: [0.0, 0.0, 90.0]"


def test_findings_are_complete_only_without_doubt() -> None:
    good = Finding("T1", PROVEN, "", "")
    assert Findings((good,)).complete
    assert not Findings((good,), "tilted").complete
    assert not Findings((good, Finding("T2", OPEN, "", ""))).complete
    assert not Findings((good, Finding("T2", WRONG, "", ""))).complete


@by_vehicle
def test_the_picture_shows_what_is_wrong(vehicle: Vehicle) -> None:
    name = vehicle.thrusters[0].name
    wrenches = {name: tuple(map(float, -effectiveness(vehicle)[:, 0]))}
    good, bad = (svg(vehicle, Findings((Finding(name, verdict, "", ""),), "", wrenches)) for verdict in (PROVEN, WRONG))
    assert good.count(BAD) < bad.count(BAD)
    assert all(one.name in bad for one in vehicle.thrusters)


def test_the_picture_states_dead_bands_and_supply() -> None:
    rows = (
        Finding("dead band of main", WRONG, "25 us", "they stand at 41 us, run at 45 us"),
        Finding("supply sag under load", PROVEN, "50 mohm", "51 mohm"),
    )
    picture = svg(HINDRAX, Findings(rows))
    assert "dead band of main: claimed 25 us, they stand at 41 us, run at 45 us" in picture
    assert "supply sag under load: claimed 50 mohm, 51 mohm" in picture
    assert picture.count(BAD) == svg(HINDRAX, Findings(rows[1:])).count(BAD) + 1


def test_the_record_holds_for_its_geometry_only() -> None:
    assert unproven(HINDRAX).code is NotProven.NEVER
    proven = replace(HINDRAX, commissioned=Commissioned(geometry_hash(HINDRAX), "2026-11-25"))
    assert unproven(proven).code is NotProven.NONE
    assert not unproven(replace(proven, mass_kg=16.0))
    turned = mended(proven, (Mend(("sensors", "dvl75", "rotation_deg"), [0.0, 0.0, 90.0]),))
    swapped = mended(proven, (Mend(("thrusters", "T3", "channel"), 9),))
    assert unproven(turned).startswith("changed since it was commissioned on 2026-11-25 (geometry ")
    assert (unproven(turned).code, unproven(swapped).code) == (NotProven.CHANGED, NotProven.CHANGED)
    assert slowed(HINDRAX).limits.speed_mps == UNPROVEN_mps


@pytest.mark.parametrize("kind", ["velocity", "altitude"])
def test_a_second_sensor_of_a_quantity_is_judged_by_its_own_readings(kind: Capability) -> None:
    plain = HINDRAX
    first = next(
        name for name in plain.measuring(kind) if kind == "velocity" or name not in plain.measuring("velocity")
    )
    vehicle = replace(plain, sensors={**plain.sensors, "second": plain.sensors[first], "silent": plain.sensors[first]})
    work = Commissioning(vehicle)
    reading: Reading = BottomVelocity((0.0, 0.0, 0.0), 0.01, 1.0, 0.1, 0) if kind == "velocity" else Echo(2.0, 1.0)
    for at in range(20):
        for source in (first, "second"):
            work.on_reading(source, Stamped(stamp_from_s(0.1 * at), reading))
    work.rest(stamp_from_s(0.0), stamp_from_s(2.0))
    verdicts = {row.claim: row.verdict for row in work.finalize().rows}
    assert [verdicts[f"{name} mount"] for name in (first, "second", "silent")] == [OPEN, OPEN, WRONG]


def test_a_second_depth_is_judged_by_its_own_readings() -> None:
    (first,) = HINDRAX.measuring("depth")
    vehicle = replace(
        HINDRAX, sensors={**HINDRAX.sensors, **dict.fromkeys(("second", "silent"), HINDRAX.sensors[first])}
    )
    work, water = Commissioning(vehicle), vehicle.water
    for at in range(20):
        for source, depth_m in ((first, 0.2), ("second", 1.2)):
            pressure_Pa = water.surface_pressure_Pa + depth_m * water.density_kgpm3 * GRAVITY_mps2
            work.on_reading(source, Stamped(stamp_from_s(0.1 * at), Pressure(pressure_Pa, 20.0)))
    work.rest(stamp_from_s(0.0), stamp_from_s(2.0))
    verdicts = {row.claim: row.verdict for row in work.finalize().rows}
    assert (verdicts[f"{first} zero"], verdicts["second zero"], verdicts["silent depth"]) == (PROVEN, WRONG, OPEN)


def climbed(vehicle: Vehicle, true_us: float, sigma: float = 0.05) -> tuple[list[float], list[Finding]]:
    """Distances from the stop that were asked for, and what is found, where thrusters run from `true_us` on."""
    ladder, asked = DeadBandLadder(vehicle, effectiveness(vehicle)), []
    seen = [0.0]
    while (pulses := ladder.climb(lambda: (seen[0], sigma))) is not None:
        require_flyable(Goal((), pulses=pulses), vehicle)
        assert ladder._asked is not None
        asked.append(ladder._asked.next_us or 0.0)
        seen[0] = 1.0 if asked[-1] >= true_us else 0.0
    return asked, list(ladder.findings())


@by_vehicle
def test_thrusters_that_run_just_beyond_their_dead_band_are_asked_once(vehicle: Vehicle) -> None:
    asked, (finding,) = climbed(vehicle, 0.0)
    assert len(asked) == 1
    close = asked[0] <= finding_us(finding.claimed) + 8.0
    assert finding.verdict == (PROVEN if close else MEASURED), "a small vehicle turns too little"
    assert finding.mends == ()


def finding_us(text: str) -> float:
    return float(text.partition(" ")[0])


def by_later_curves(vehicle: Vehicle, later_us: float) -> Finding:
    """What is found where every curve begins later than the file says, by the turn that its forces make."""
    ladder, B, curves = DeadBandLadder(vehicle, effectiveness(vehicle)), effectiveness(vehicle), thrust_curves(vehicle)
    share = [0.0]
    while (pulses := ladder.climb(lambda: (share[0], 0.05))) is not None:
        forces_N = []
        for curve, force_N in zip(curves, pulses[0].forces_N, strict=True):
            offset_us = curve.pulse(force_N) - curve.stop_us
            left_us = max(0.0, abs(offset_us) - later_us)
            forces_N.append(curve.force(curve.stop_us + math.copysign(left_us, offset_us)))
        share[0] = float(B[YAW] @ np.array(forces_N)) / float(B[YAW] @ np.array(pulses[0].forces_N))
    (finding,) = ladder.findings()
    return finding


@by_vehicle
@pytest.mark.parametrize("later_us", [0.0, 2.0, 4.0, 6.0, 7.5])
def test_a_dead_band_that_is_wider_by_less_than_a_step_is_as_claimed(vehicle: Vehicle, later_us: float) -> None:
    assert by_later_curves(vehicle, later_us).verdict in (PROVEN, MEASURED)


@by_vehicle
@pytest.mark.parametrize("later_us", [20.0, 30.0])
def test_a_dead_band_that_is_wider_is_found_however_the_curve_begins(vehicle: Vehicle, later_us: float) -> None:
    finding = by_later_curves(vehicle, later_us)
    assert finding.verdict == WRONG
    true_us = finding_us(finding.claimed) + later_us
    assert all(abs(mended(vehicle, (mend,)).curves["main"].dead_band_us - true_us) <= 4.5 for mend in finding.mends)


@pytest.mark.parametrize("true_us", [34.0, 45.0, 60.0, 70.0])
def test_a_wider_dead_band_is_found_to_four_microseconds_and_mended(true_us: float) -> None:
    asked, (finding,) = climbed(HINDRAX, true_us)
    assert finding.verdict == WRONG
    (mend,) = finding.mends
    assert mend.keys == ("curves", "main", "dead_band_us")
    assert true_us <= mended(HINDRAX, (mend,)).curves["main"].dead_band_us <= true_us + 4.5
    assert len(asked) < 12


def test_a_dead_band_beyond_what_is_harmless_is_wrong_without_a_line() -> None:
    asked, (finding,) = climbed(HINDRAX, 500.0)
    assert (finding.verdict, finding.mends) == (WRONG, ())
    assert finding.found == f"they stand at {asked[-1]:.0f} us from the stop"


def test_a_wider_dead_band_of_a_table_has_no_line_that_mends_it() -> None:
    (heavy,) = [one for one in EVERY if one.name == "bluerov2-heavy"]
    _, (finding,) = climbed(heavy, 50.0)
    assert finding.verdict == WRONG
    assert finding.mends == ()
    assert "measure the curve again" in finding.remedy


@pytest.mark.parametrize("sigma", [math.nan, 0.4])
def test_water_that_turns_the_vehicle_shows_no_dead_band(sigma: float) -> None:
    asked, (finding,) = climbed(HINDRAX, 0.0, sigma)
    assert len(asked) == 1
    assert (finding.verdict, finding.mends) == (MEASURED, ())


def test_dead_bands_are_asked_for_by_a_turn_and_nothing_else() -> None:
    B = effectiveness(HINDRAX)
    pulses = DeadBandLadder(HINDRAX, B).climb(lambda: (math.nan, math.nan))
    assert pulses is not None
    assert [one.seconds for one in pulses] == [QUARTER_S, 2.0 * QUARTER_S, QUARTER_S]
    for pulse in pulses:
        wrench = B @ np.array(pulse.forces_N)
        assert np.allclose(np.delete(wrench, YAW)[[0, 1, 2]], 0.0, atol=1e-9)
        assert abs(wrench[YAW]) > 0.5


def test_that_no_thruster_pushes_may_be_the_dead_bands() -> None:
    work = as_claimed(HINDRAX)
    work.wirings = tuple(Wiring(None, 1, 0.0, likelihood=1.0) for _ in HINDRAX.thrusters)
    assert all("dead bands" in row.remedy for row in work._thruster_claims() if row.verdict == WRONG)
    work.wirings = (work.wirings[0], *as_claimed(HINDRAX).wirings[1:])
    assert "dead bands" not in work._thruster_claims()[0].remedy


@pytest.mark.parametrize(
    ("declared_ohm", "true_ohm", "verdict", "mends"),
    [
        (None, 0.05, MEASURED, 0),
        (0.05, 0.05, PROVEN, 0),
        (0.05, 0.02, PROVEN, 0),
        (0.05, 0.06, PROVEN, 0),
        (0.05, 0.15, WRONG, 1),
        (0.0, 0.05, WRONG, 1),
    ],
)
def test_a_supply_that_sags_more_than_declared_is_found(
    declared_ohm: float | None, true_ohm: float, verdict: str, mends: int
) -> None:
    battery = replace(HINDRAX.sensors["ms5837"], device="ina226", address=0x44)
    vehicle = replace(HINDRAX, supply_ohm=declared_ohm, sensors={**HINDRAX.sensors, "ina226": battery})
    rng = np.random.default_rng(3)
    work = Commissioning(vehicle)
    for at in range(300):
        current_A = 2.5 * (at > 30 and at % 10 > 6)
        voltage_V = 15.0 - true_ohm * current_A + 0.003 * rng.normal()
        work.on_reading("ina226", Stamped(stamp_from_s(0.1 * at), Battery(voltage_V, current_A)))
    work.rest(stamp_from_s(0.0), stamp_from_s(3.0))
    (row,) = [one for one in work.finalize().rows if one.claim == "supply sag under load"]
    assert (row.verdict, len(row.mends)) == (verdict, mends)
    assert f"{1e3 * true_ohm:.0f}" == row.found.partition(" ")[0] or abs(finding_us(row.found) - 1e3 * true_ohm) < 2.0
    if row.mends:
        assert row.mends[0].line.startswith("supply_ohm: 0.")
        assert mended(vehicle, row.mends).supply_ohm == pytest.approx(true_ohm, abs=0.002)


def test_a_battery_sensor_without_current_shows_no_sag() -> None:
    battery = replace(HINDRAX.sensors["ms5837"], device="ads1115", address=0x48)
    vehicle = replace(HINDRAX, supply_ohm=0.05, sensors={**HINDRAX.sensors, "ads1115": battery})
    work = Commissioning(vehicle)
    for at in range(100):
        work.on_reading("ads1115", Stamped(stamp_from_s(0.1 * at), Battery(15.0, math.nan)))
    work.rest(stamp_from_s(0.0), stamp_from_s(3.0))
    (row,) = [one for one in work.finalize().rows if one.claim == "supply sag under load"]
    assert (row.verdict, row.mends) == (MEASURED, ())


def test_no_sensor_is_called_wrong_where_the_dead_bands_are() -> None:
    (source,) = HINDRAX.measuring("depth")
    work, water = as_claimed(HINDRAX), HINDRAX.water
    for at in range(20):
        pressure_Pa = water.surface_pressure_Pa + 1.2 * water.density_kgpm3 * GRAVITY_mps2
        work.on_reading(source, Stamped(stamp_from_s(0.1 * at), Pressure(pressure_Pa, 20.0)))
    work.rest(stamp_from_s(0.0), stamp_from_s(2.0))
    assert {row.claim: row.verdict for row in work.finalize().rows}[f"{source} zero"] == WRONG
    work._ladder = DeadBandLadder(HINDRAX, effectiveness(HINDRAX))
    share = iter([0.0, 0.0, 1.0, 1.0])
    while work._ladder.climb(lambda: (next(share), 0.05)) is not None:
        pass
    rows = {row.claim: row for row in work.finalize().rows}
    assert rows["dead band of main"].verdict == WRONG
    assert (rows[f"{source} zero"].verdict, rows[f"{source} zero"].mends) == (OPEN, ())
    assert "dead bands first" in rows[f"{source} zero"].remedy
