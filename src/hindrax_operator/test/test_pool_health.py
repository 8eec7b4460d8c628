"""What a pool test reports of devices, nodes and the record before and while it flies."""

import itertools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_core.errors import HindraxError
from hindrax_operator.pool_run import (
    ABORT,
    CONTINUE,
    await_steady_state,
    report_devices,
    require_measurements,
    state_before_arming,
    watch_record,
    watch_thrusters,
)

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


def hearing(diagnostics: dict[str, SimpleNamespace]) -> Any:
    """An operator of which nothing is needed but what it has heard."""
    return SimpleNamespace(diagnostics=diagnostics)


def test_each_device_is_reported_of_once_when_it_is_up_and_when_its_reason_to_wait_changes() -> None:
    reports: list[str] = []
    progress: Any = SimpleNamespace(report=reports.append)
    reported: dict[str, str] = {}
    for level, message in (
        (ERROR, "has not answered yet"),
        (ERROR, "has not answered yet"),
        (ERROR, "gyroscope: resting for 1 s"),
        (ERROR, "gyroscope: resting for 2 s"),
        (OK, "measuring"),
        (OK, "measuring"),
    ):
        one = SimpleNamespace(level=level, message=message)
        report_devices(hearing({"hindrax: icm20948": one}), reported, progress)
    assert reports == ["icm20948: has not answered yet", "icm20948: gyroscope: resting for 1 s", "icm20948: ok"]


def test_a_flight_that_is_no_longer_recorded_reports_it_at_once_and_ends_by_default() -> None:
    reports: list[str] = []
    progress: Any = SimpleNamespace(report=reports.append)
    reported = {"recorder": "starting"}
    full = SimpleNamespace(level=ERROR, message="less than 200 MB are free on the disk")
    lossy = SimpleNamespace(level=WARN, message="recording; 3 messages lost")
    for status in (None, lossy, full, full, lossy, full):
        found = {"hindrax: recorder": status} if status else {}
        watch_record(hearing(found), reported, progress, CONTINUE)
    assert reports == ["recorder: ok", f"recorder: {full.message}", "recorder: ok", f"recorder: {full.message}"]
    with pytest.raises(HindraxError, match="200 MB are free on the disk; --without-record continue flies on"):
        watch_record(hearing({"hindrax: recorder": full}), reported, progress, ABORT)


def test_what_is_not_well_is_not_called_up_before_the_arming() -> None:
    well = {"dvl75": "", "thrusters": ""}
    assert state_before_arming(well) == "sensors and thrusters are up"
    silent = well | {"dvl75": "no byte for 1 s", "ms5837": "absent"}
    assert state_before_arming(silent) == "the thrusters are up, but not healthy: dvl75, ms5837"


def test_without_a_measurement_that_every_maneuver_needs_nothing_is_armed() -> None:
    age = (
        "sensor_age: depth from autopilot received never, wanted at most 1.00 s; check the autopilot and its barometer"
    )
    require_measurements({"pilot": "battery: 12.4 V, wanted at least 13.0 V; charge the battery", "thrusters": "hot"})
    with pytest.raises(HindraxError) as refused:
        require_measurements({"pilot": f"battery: 12.4 V; {age}"})
    assert str(refused.value) == f"not armed: {age}"


def test_a_thruster_that_is_left_out_in_flight_is_told_of_at_once_and_once() -> None:
    reports: list[str] = []
    progress: Any = SimpleNamespace(report=reports.append)
    told: set[str] = set()
    missing = "T3: 82 % of its thrust is missing"
    for disabled, reasons in (([], []), (["T3"], [missing]), (["T3"], [missing]), (["T3", "T5"], [missing, "broken"])):
        health = SimpleNamespace(disabled=disabled, reasons=reasons)
        watch_thrusters(SimpleNamespace(health=health), told, progress)
    ending = "it is left out, and the flight goes on without it"
    assert reports == [f"{missing}; {ending}", f"T5: broken; {ending}"]


@pytest.mark.parametrize(("steps_to_lock", "waited_s"), [(0, 0.0), (30, 3.0), (10_000, 20.0)])
def test_the_state_of_the_vehicle_gets_time_to_settle_before_the_arming(steps_to_lock: int, waited_s: float) -> None:
    reported = {"estimator_health": "", "navigator": "DVL has no bottom lock"} if steps_to_lock else {}
    reports: list[str] = []
    now_ns = 0

    def wait(done: Callable[[], bool], _seconds: float, _what: object) -> None:
        nonlocal now_ns
        for step in itertools.count():
            if step >= steps_to_lock:
                reported["navigator"] = reported["estimator_health"] = ""
            if done():
                return
            now_ns += 100_000_000

    operator = SimpleNamespace(now=lambda: now_ns, wait=wait)
    await_steady_state(operator, reported, SimpleNamespace(report=reports.append))  # type: ignore[arg-type]  # stand-ins
    assert 1e-9 * now_ns == pytest.approx(waited_s, abs=0.11)
    assert reports == ["waiting until the state of the vehicle is settled"]
