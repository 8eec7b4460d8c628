"""A thruster that is wired in another way than the vehicle file says is named, with the line to change."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.joint_identification import identify_jointly
from hindrax_analysis.identification.record_identification import (
    IdentificationTask,
    Span,
    identify_sources,
    open_sources,
)
from hindrax_analysis.records.recording import Recording, events, joined
from hindrax_analysis.records.third_party_bag import TopicSelection
from hindrax_analysis.records.wrong_thrusters import wrong_thrusters
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_core.signals import Thrust
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import Code

HEAVY = load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml")
STEP_S, LASTS_S = 0.05, 90.0
PLANAR = (0, 1, 5)
MASS, K_Q, K_L = np.array([17.0, 24.0, 0.28]), np.array([60.0, 90.0, 0.6]), np.array([5.0, 8.0, 0.2])
PUSH = np.array([30.0, 30.0, 5.0])
AS_TOLD: dict[int, float] = {}


def wired(factors: dict[int, float], exchanged: tuple[int, int] | None = None) -> Array:
    """What the thrusters do, (6, 8): by the file, but for factors of some and an exchange of two."""
    B = np.array(effectiveness(HEAVY))
    for thruster, factor in factors.items():
        B[:, thruster] *= factor
    if exchanged:
        B[:, exchanged] = B[:, exchanged[::-1]]
    return array(B)


def flown(B: Array, seed: int = 3, push: Array = PUSH) -> tuple[Array, Array, Array]:
    """Times (n,), velocities (n, 3) of surge, sway and yaw, forces (n, 8) that a pilot's stack believes to apply."""
    rng = np.random.default_rng(seed)
    t = STEP_S * np.arange(round(LASTS_S / STEP_S))
    share_out = np.linalg.pinv(np.array(effectiveness(HEAVY))[list(PLANAR)])
    pushes = np.repeat(rng.uniform(-1.0, 1.0, (len(t) // 30 + 1, 3)) * push, 30, axis=0)[: len(t)]
    forces, v, seen, lagged = pushes @ share_out.T, np.zeros(3), [], np.zeros(8)
    for row in forces:
        seen.append(v + rng.normal(0.0, [0.005, 0.005, 0.003]))
        lagged += (row - lagged) * STEP_S / 0.15
        u, aside, r = v
        coriolis = MASS[1] * aside * r, -MASS[0] * u * r, (MASS[0] - MASS[1]) * u * aside
        v = v + STEP_S * (B[list(PLANAR)] @ lagged - K_L * v - K_Q * np.abs(v) * v + coriolis) / MASS
    return array(t), array(np.array(seen)), array(forces)


def record(B: Array, seed: int = 3, push: Array = PUSH) -> Recording:
    """What a reader makes of such a flight."""
    t, seen, forces = flown(B, seed, push)
    velocity = np.full((len(t), 6), np.nan)
    velocity[:, PLANAR] = seen
    wrench = forces @ np.array(effectiveness(HEAVY)).T
    nothing = np.zeros(0), np.zeros((0, 3))
    return Recording("made", t, array(velocity), t, array(wrench), *nothing, forces=forces)


@pytest.mark.parametrize(
    ("B", "what", "remedy"),
    [
        (wired({0: -1.0}), "T1 pushes the other way", "`reversed: {}` of T1"),
        (wired({3: -1.0}), "T4 pushes the other way", "`reversed: {}` of T4"),
        (wired({1: 0.0}), "T2 does not push", "propeller and cable of T2"),
        (wired({0: -1.0, 2: -1.0}), "T1 and T3 push the other way", "`reversed: {}` of T1 and `reversed: {}` of T3"),
        (wired({}, (0, 3)), "T1 and T4 are exchanged", "exchange `channel` of T1 and T4"),
    ],
    ids=["T1 turned", "T4 turned", "T2 dead", "T1 and T3 turned", "T1 and T4 exchanged"],
)
def test_what_is_wired_in_another_way_is_named(B: Array, what: str, remedy: str) -> None:
    found = wrong_thrusters([record(B)], HEAVY)
    about = found[0]
    assert about.code is Code.WRONG_THRUSTERS
    assert what in str(about.numbers["what"]).split(" or ")
    other = str(not HEAVY.thrusters[0].reversed).lower()
    assert remedy.format(other, other) in about
    assert 1 in found


@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_said_of_thrusters_that_push_as_they_should(seed: int) -> None:
    assert not wrong_thrusters([record(wired(AS_TOLD), seed)], HEAVY)


@pytest.mark.parametrize("share", [0.6, 0.8, 1.3])
def test_a_weak_or_a_strong_thruster_is_no_wrong_one(share: float) -> None:
    assert not wrong_thrusters([record(wired({0: share}))], HEAVY)


def test_a_wrong_curve_of_all_is_no_wrong_thruster() -> None:
    made = record(wired(AS_TOLD))
    assert not wrong_thrusters([replace(made, forces=array(np.abs(made.forces) * made.forces / 10.0))], HEAVY)


def test_the_fit_gets_the_force_of_each_thruster_in_a_part_of_a_record_too() -> None:
    made = record(wired(AS_TOLD)).between(10.0, 12.0)
    assert len(made.forces) == len(made.wrench_t)
    pushed = [one.reading for one in events(made, 0) if isinstance(one.reading, Thrust)]
    B = np.array(effectiveness(HEAVY))
    assert len(pushed) == len(made.forces)
    assert all(one.wrench == pytest.approx(B @ np.array(one.forces_N)) for one in pushed)


def test_of_two_parts_of_a_record_that_with_the_thrusters_has_their_forces() -> None:
    made = record(wired(AS_TOLD))
    nothing = array(np.zeros(0)), array(np.zeros((0, 6)))
    moved, pushed = (
        replace(made, wrench_t=nothing[0], wrench=nothing[1], forces=array(np.zeros((0, 0)))),
        replace(made, velocity_t=nothing[0], velocity=nothing[1]),
    )
    assert joined(moved, pushed).forces == pytest.approx(made.forces)
    assert joined(pushed, moved).forces == pytest.approx(made.forces)
    assert not len(joined(made, made).forces)


def test_a_record_of_wrenches_says_nothing_of_thrusters() -> None:
    made = record(wired({0: -1.0}))
    assert not wrong_thrusters([replace(made, forces=array(np.zeros((0, 0))))], HEAVY)


def test_thrusters_that_one_axis_cannot_tell_apart_are_named_together() -> None:
    """Pushed ahead and round alone, the thrusters of one side have one force."""
    made = record(wired({0: -1.0}), push=array(PUSH * [1.0, 0.0, 1.0]))
    velocity = made.velocity.copy()
    velocity[:, 1] = np.nan
    about = wrong_thrusters([replace(made, velocity=array(velocity))], HEAVY)[5]
    assert "T1 pushes the other way or T3 pushes the other way" in about


def written(B: Array, folder: Path) -> Path:
    """The flight as CSV, a force for each thruster."""
    t, seen, forces = flown(B)
    file = folder / "flight.csv"
    header = ",".join(["t", "u", "v", "r", *(f"thruster{i}_N" for i in range(1, 9))])
    np.savetxt(file, np.column_stack([t, seen, forces]), delimiter=",", header=header, comments="", fmt="%.5f")
    return file


def test_no_motion_of_a_wrong_thruster_is_identified_and_the_named_line_mends_it(tmp_path: Path) -> None:
    file = written(wired({0: -1.0}), tmp_path)
    task, short = IdentificationTask(axes=(0,)), IdentificationTask(span=Span(to_s=25.0))
    sources = open_sources([file], TopicSelection(), HEAVY)
    alone, together = identify_sources(sources, HEAVY, task).results, identify_jointly(sources, HEAVY, short)
    for reasons in (alone.motions["surge"].reasons, *(one.reasons for one in together.motions.values())):
        assert [reason.code for reason in reasons] == [Code.WRONG_THRUSTERS]
    first = HEAVY.thrusters[0]
    turned = replace(HEAVY, thrusters=(replace(first, azimuth_deg=first.azimuth_deg - 180.0), *HEAVY.thrusters[1:]))
    surge = identify_sources(open_sources([file], TopicSelection(), turned), turned, task).results.motions["surge"]
    assert surge.identifiable
    assert surge.coefficients["k_q"].value == pytest.approx(K_Q[0], abs=3.0 * surge.coefficients["k_q"].std_calibrated)
