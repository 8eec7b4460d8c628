"""What a pool test tells of its plan before anything starts."""

from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_bringup.node_options import Tuning
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.plan import plans_of
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Pool, load_vehicle
from hindrax_operator.pool_run import ABORT, PoolOptions, planned, run_pool_test

OPTIONS = PoolOptions(("surge", "yaw"), default_vehicle(), None, None, 1, "plateaus", "hold", ABORT, True, False)


def test_the_plan_is_told_as_the_pilot_has_it() -> None:
    vehicle = load_vehicle(default_vehicle())
    assert planned(vehicle, OPTIONS) == [f"plan: {plan}" for plan in plans_of(vehicle, ("surge", "yaw"))]


def test_before_the_start_no_plan_is_told_that_only_the_pilot_knows_nor_of_signals() -> None:
    vehicle = load_vehicle(default_vehicle())
    tuned = replace(OPTIONS, tuning=Tuning(settings=("pilot.plan.levels:=6",)))
    assert tuned.plan_is_the_pilots
    assert planned(vehicle, tuned) == []
    assert planned(vehicle, replace(OPTIONS, excitation="chirp")) == []


def test_a_pool_without_room_is_refused_before_anything_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = default_vehicle().read_text(encoding="utf-8")
    (pool,) = [line for line in text.splitlines() if line.startswith("pool:")]
    file = tmp_path / "short.yaml"
    file.write_text(text.replace(pool, "pool: {length_m: 2.0, width_m: 6.0, depth_m: 1.8}"), encoding="utf-8")
    assert load_vehicle(file).pool == Pool(2.0, 6.0, 1.8)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"surge: the pool leaves -0\.19 m of room"):
        run_pool_test(replace(OPTIONS, vehicle_file=file))
    assert not (tmp_path / "runs").exists()
