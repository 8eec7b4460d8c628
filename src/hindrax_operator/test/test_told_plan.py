"""What a pool test tells of its plan before anything starts, and what it keeps of a flight that did not begin."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Self

import pytest

from hindrax_analysis import terminal
from hindrax_analysis.identification import bag_identification
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import StackLock
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_control.maneuver.plan import plans_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.refusals import from_sentence
from hindrax_core.vehicle import Pool, load_vehicle
from hindrax_operator import commissioning_run, pool_run
from hindrax_operator.commissioning_run import commission_mock
from hindrax_operator.pool_run import ABORT, FlownManeuver, PoolOptions, planned, run_pool_test

OPTIONS = PoolOptions(("surge", "yaw"), default_vehicle(), None, None, 1, "plateaus", "hold", ABORT, True, False)


def test_the_plan_is_reported_as_the_pilot_has_it() -> None:
    vehicle = load_vehicle(default_vehicle())
    assert planned(vehicle, OPTIONS) == [f"plan: {plan}" for plan in plans_of(vehicle, ("surge", "yaw"))]


def test_before_the_start_no_plan_is_reported_that_only_the_pilot_knows_nor_of_signals() -> None:
    vehicle = load_vehicle(default_vehicle())
    tuned = replace(OPTIONS, tuning=ParameterOverrides(settings=("pilot.plan.levels:=6",)))
    assert tuned.plan_is_the_pilots
    assert planned(vehicle, tuned) == []
    assert planned(vehicle, replace(OPTIONS, excitation="chirp")) == []


def test_a_pool_without_room_is_refused_before_anything_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = hindrax_file(tmp_path, ("^pool: .*", "pool: {length_m: 2.0, width_m: 6.0, depth_m: 1.8}"))
    assert load_vehicle(file).pool == Pool(2.0, 6.0, 1.8)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"surge: the pool leaves -0\.19 m of room"):
        run_pool_test(replace(OPTIONS, vehicle_file=file))
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("armed", [False, True])
def test_ctrl_c_before_the_flight_leaves_the_name_of_the_run_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, armed: bool
) -> None:
    def interrupted(_options: object, flight: FlownManeuver, *_: object, **_named: object) -> None:
        flight.armed = armed
        raise KeyboardInterrupt

    class NoStack:
        """Starts nothing."""

        entry = StackLock(0, mock=False, vehicle="", folder="")

        def __init__(self, _options: object) -> None: ...

        def __enter__(self) -> Self:
            return self

        def __exit__(self, *_: object) -> None: ...

    monkeypatch.setattr(pool_run, "StackProcess", NoStack)
    monkeypatch.setattr(pool_run, "_operate", interrupted)
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run_pool_test(replace(OPTIONS, out=str(out)))
    assert out.exists() == armed


class RefusedStack:
    """Ends before it begins."""

    def __init__(self, _options: object) -> None: ...

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None: ...

    @property
    def entry(self) -> StackLock:
        """Never made."""
        raise UsageError("ROS_DOMAIN_ID: found 'abc'")


def test_nothing_is_left_of_a_run_that_was_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool_run, "StackProcess", RefusedStack)
    monkeypatch.setattr(commissioning_run, "StackProcess", RefusedStack)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="abc"):
        run_pool_test(OPTIONS)
    with pytest.raises(UsageError, match="abc"):
        commission_mock(default_vehicle(), MockOptions(), None, lambda _: None)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_of_a_run_whose_record_has_no_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise HindraxError("the disk is full")

    monkeypatch.setattr(BagLimits, "check_space", full)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HindraxError, match="full"):
        run_pool_test(OPTIONS)
    assert list(tmp_path.iterdir()) == []


def test_who_waits_for_the_identification_sees_that_it_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    going_on: list[str] = []

    @contextlib.contextmanager
    def working(sentence: str) -> Iterator[None]:
        going_on.append(sentence)
        yield

    def identified(*_: object, **__: object) -> None:
        raise HindraxError(", ".join(going_on))

    monkeypatch.setattr(pool_run, "fly", lambda *_, **_named: FlownManeuver())
    monkeypatch.setattr(terminal, "working", working)
    monkeypatch.setattr(bag_identification, "identify_run", identified)
    with pytest.raises(HindraxError, match=r"^flown; but identifying; the record is stored; "):
        run_pool_test(replace(OPTIONS, out=str(tmp_path / "run")))


def test_results_that_find_no_room_are_reported_with_the_end_of_the_flight_and_how_to_get_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise HindraxError("coefficients.yaml: cannot be written; make room")

    monkeypatch.setattr(
        pool_run, "fly", lambda *_, **_named: FlownManeuver(aborted=from_sentence("record: recording waits for room"))
    )
    monkeypatch.setattr(bag_identification, "identify_run", full)
    out = tmp_path / "run"
    with pytest.raises(HindraxError) as reported:
        run_pool_test(replace(OPTIONS, out=str(out)))
    assert str(reported.value) == (
        "aborted by record: recording waits for room; but coefficients.yaml: cannot be written; make room; "
        f"the record is stored; then `./hindrax identify {out}/bag` gives the results"
    )
