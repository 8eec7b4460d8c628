"""The dress rehearsal: a timetable that adds up, clearances that fit the pool, bands that hold the truth."""

import contextlib
import itertools
import json
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli import pool_plan
from hindrax_cli.command_line import load, main, parser_of
from hindrax_control.maneuver.plan import plans_of
from hindrax_core.text.refusals import NOTHING
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.online.aim import Aim
from hindrax_sim.flights.rehearsal import ExpectedBand, Rehearsal
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.pool import PoolWalls


def test_the_rehearsal_shows_times_clearances_charge_and_bands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pool-test", "--plan", "--world", "ideal", "--dof", "roll", "yaw", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    rows = found["timetable"]
    assert [row["motion"] for row in rows] == [plan["motion"] for plan in found["plan"]] == ["roll", "yaw"]
    assert rows[0]["begin_s"] == 0.0
    assert rows[-1]["end_s"] == found["seconds"]
    assert all(row["end_s"] - row["begin_s"] > plan["seconds"] for row, plan in zip(rows, found["plan"], strict=True))
    assert all(one["end_s"] <= later["begin_s"] for one, later in itertools.pairwise(rows))
    vehicle = load_vehicle(default_vehicle())
    assert [tuple(plan["rates"]) for plan in found["plan"]] == [one.rates for one in plans_of(vehicle, ("roll", "yaw"))]
    pool = vehicle.pool
    assert all(0.0 < row["wall_m"] < 0.5 * pool.width_m and 0.0 < row["floor_m"] < pool.depth_m for row in rows)
    assert found["charge_Ah"] == pytest.approx(sum(row["charge_Ah"] for row in rows))
    assert all(row["charge_Ah"] > 0.0 for row in rows)
    assert found["bands"].keys() == {"roll", "yaw"}
    for motion, widest in (("roll", 0.15), ("yaw", 0.1)):
        band = found["bands"][motion]
        assert 0.0 < band["noise"] < band["calibrated"] < widest
    assert found["aborted"] is None


def test_a_pool_without_room_is_reported_before_anything_is_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = hindrax_file(tmp_path, ("^pool: .*", "pool: {length_m: 2.0, width_m: 6.0, depth_m: 1.8}"))
    assert main(["pool-test", "--plan", "--vehicle", str(file)]) == 2
    assert "surge: the pool leaves -0.19 m of room" in capsys.readouterr().err


def test_the_clearance_is_that_of_the_hull() -> None:
    hindrax = load_vehicle(default_vehicle())
    upright = replace(hindrax, center_of_mass_m=(0.0, 0.0, 0.0))
    plant, (length_m, width_m, height_m) = Plant(upright), hindrax.envelope_m
    plant.place((1.0, -2.0, 0.5), (0.0, 0.0, 0.0))
    pool = hindrax.pool
    assert PoolWalls(upright).clearance_m(plant) == pytest.approx(
        (
            0.5 * (pool.length_m - length_m) - 1.0,
            0.5 * (pool.width_m - width_m) - 2.0,
            pool.depth_m - 0.5 - 0.5 * height_m,
        )
    )


def test_an_experiment_is_rehearsed_and_its_minutes_cut_what_flies(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    reached: list[object] = []
    monkeypatch.setattr(pool_plan, "working", lambda _sentence: contextlib.nullcontext(reached.append))
    assert main(["pool-test", "--plan", "--dof", "yaw", "surge", "--until", "5%", "--minutes", "0.9", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    fastest, slowest, *_ = next(plan["rates"] for plan in found["plan"] if plan["motion"] == "yaw")
    assert fastest > slowest > 0.0
    assert found["bands"]["yaw"]["noise"] < 0.05
    assert found["bands"]["surge"]["noise"] > 0.0, "also of a drag that came out negative"
    assert found["aborted"] is None
    assert found["ended"] == "0.9 minutes are over; more was wanted of surge"
    assert len(reached) >= 10
    assert str(reached[-1]).startswith("surge, 2 of 2, 5"), (
        "the motion, how many there are, and the time of what is rehearsed"
    )


@pytest.mark.parametrize(
    ("words", "world"),
    [
        (["--mock"], "pool"),
        ([], "pool"),
        (["--mock", "--world", "tether=1"], "tether=1"),
        (["--mock", "--simulator", "gz"], "ideal"),
    ],
)
def test_an_experiment_is_predicted_in_the_water_in_which_it_is_flown(
    monkeypatch: pytest.MonkeyPatch, words: list[str], world: str
) -> None:
    """Before every experiment, ideal water was rehearsed, and its narrow intervals were promised."""
    arguments = parser_of(load("pool-test")).parse_args([*words, "--dof", "yaw", "--minutes", "1"])
    rehearsed: list[str] = []

    def rehearse(motions: tuple[str, ...], _seed: int, world: str, **_: object) -> Rehearsal:
        rehearsed.append(world)
        band = ExpectedBand(speed=1.0, noise=0.01, calibrated=0.03, added_mass=0.1, reasons=())
        return Rehearsal("hindrax", world, (), (), dict.fromkeys(motions, band), "", NOTHING)

    monkeypatch.setattr(pool_plan, "rehearse", rehearse)
    assert pool_plan.predicted_of(arguments, Aim(None, 1.0)) == {"yaw": 0.03}
    assert rehearsed == [world]


@pytest.mark.parametrize(
    ("line", "code", "sentence"),
    [
        ("pool: {length_m: 1.5, width_m: 1.2, depth_m: 0.9}", 1, "start: pool_box: "),
        ("mass_kg: 25.0", 2, "found 95 N of net weight, wanted less than the 62 N that its thrusters give in heave"),
    ],
)
def test_what_can_never_begin_is_reported_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, code: int, sentence: str
) -> None:
    """These were rehearsed for two hours of the vehicle, in minutes, and nobody said why nothing began."""
    file = hindrax_file(tmp_path, (f"^{line.partition(':')[0]}: .*", line))
    assert main(["pool-test", "--plan", "--world", "ideal", "--mock", "--vehicle", str(file)]) == code
    shown = capsys.readouterr()
    assert sentence in " ".join((shown.out + shown.err).split())
