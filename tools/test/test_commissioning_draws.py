"""A few of the draws of commissioning: every kind of fault once, found and named, and no vehicle tilted too far."""

from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_control.commissioning.findings import MEASURED, PROVEN, mended
from hindrax_core.testing import THOROUGH
from hindrax_sim.conditions.world_table import IDEAL, POOL
from hindrax_sim.faults.fault_registry import FaultSpec, as_built
from hindrax_sim.flights.commissioning_flight import fly_commissioning
from hindrax_tools.commissioning_draws import (
    ALWAYS_S,
    VEHICLES,
    Draw,
    Judged,
    MOST_TILT_deg,
    cases,
    draws,
    judge,
    kept,
    vehicle_of,
)

pytestmark = pytest.mark.long

FLOWN: tuple[tuple[str, tuple[str, ...], int], ...] = (
    ("bluerov2-heavy", ("thruster_fails:T5", "thruster_reversed:T2"), 4),
    ("hindrax", ("turned_yaw_90:dvl75", "turned_roll_180:icm20948", "turned_pitch_90:ping1d"), 6),
    # Its range falls with the dive by chance: the wall is that much nearer below.
    ("lbv", ("thrusters_swapped:PORT-STARBOARD", "turned_roll_90:ping1d"), 7019),
    # A swing from before hides that it does not push: it is pulsed once more.
    ("bluerov2", ("thruster_fails:T6",), 41054),
)
if THOROUGH:
    FLOWN += (
        # Ended by the velocity's guard before the body was moved: single thrusters show how it is turned.
        ("bluerov2", ("turned_yaw_180:dvl75",), 41070),
        # Turns by 0.7 deg/s while its gyroscope is set to zero: no fault of the magnetometer.
        ("bluerov2", ("thrusters_swapped:T4-T5", "thrusters_swapped:T5-T6"), 41062),
    )


def spec(text: str) -> FaultSpec:
    """A fault from the start, for good."""
    name, _, target = text.partition(":")
    return FaultSpec(name, (target,), 0.0, ALWAYS_S)


@pytest.mark.parametrize(("vehicle", "faults", "seed"), FLOWN)
def test_the_fault_is_named(vehicle: str, faults: tuple[str, ...], seed: int) -> None:
    judged = judge(Draw(vehicle, "any", tuple(map(spec, faults)), seed))
    assert judged.named, judged.said
    assert judged.tilt_deg < MOST_TILT_deg


def test_wider_dead_bands_and_a_supply_that_sags_are_found_and_mended() -> None:
    hindrax = vehicle_of("hindrax")
    battery = replace(hindrax.sensors["ms5837"], device="ina226", address=0x44)
    vehicle = replace(hindrax, supply_ohm=0.05, sensors={**hindrax.sensors, "ina226": battery})
    built = as_built(vehicle, [spec("dead_bands_wider:curves"), spec("supply_sags:supply")])
    findings = fly_commissioning(vehicle, 1, IDEAL, built=built).findings
    assert {row.claim for row in findings.wrong} == {"dead band of main", "supply sag under load"}
    repaired = mended(vehicle, findings.mends)
    assert repaired.curves["main"].dead_band_us == pytest.approx(45.0, abs=4.5)
    assert repaired.supply_ohm == pytest.approx(0.2, abs=0.02)


def test_nothing_is_found_where_nothing_is_wrong_and_every_sensor_of_a_kind_is_judged() -> None:
    vehicle = vehicle_of("lbv")
    second = {f"second_{name}": vehicle.sensors[name] for name in ("ms5837", "icm20948")}
    flight = fly_commissioning(replace(vehicle, sensors={**vehicle.sensors, **second}), 8, POOL)
    assert not flight.findings.ended
    assert {row.verdict for row in flight.findings.rows} == {PROVEN, MEASURED}
    claims = [row.claim for row in flight.findings.rows]
    assert {"second_ms5837 zero", "second_ms5837 direction", "second_icm20948 magnetometer"} <= set(claims)
    assert claims.count("net buoyancy") == 1


def test_draws_cover_every_vehicle_and_kind() -> None:
    made = draws(48, 1)
    for name in VEHICLES:
        kinds = {kind for kind, _ in cases(vehicle_of(name))}
        assert {one.kind for one in made if one.vehicle == name} == kinds
    assert draws(5, 2) == draws(5, 2) != draws(5, 3)


def test_draws_that_are_kept_are_not_flown_again(tmp_path: Path) -> None:
    file, flown = tmp_path / "draws.jsonl", list[Draw]()

    def fly(draw: Draw, world: str) -> Judged:
        flown.append(draw)
        return Judged(draw, True, 5.0, 50.0, world)

    made = draws(4, 1)
    assert list(kept(made[:2], file, "pool", fly)) == [Judged(one, True, 5.0, 50.0, "pool") for one in made[:2]]
    with file.open("a", encoding="utf-8") as stream:
        stream.write('{"vehicle": "lbv", "text": ')  # its run was ended here
    assert [one.draw for one in kept(made, file, "pool", fly)] == made
    assert [one.draw for one in kept(made, file, "pool", fly)] == made
    assert flown == made
