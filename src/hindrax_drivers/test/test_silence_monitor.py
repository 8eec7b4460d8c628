"""When a serial line counts as silent, or as speaking another language: told once, until it is well again."""

import pytest

from hindrax_core.events import stamp_from_s
from hindrax_core.readings import Inertial, Pressure
from hindrax_drivers.driver import MeasurementMonitor, SilenceMonitor

STALL_S = 3.0


@pytest.fixture
def monitor() -> SilenceMonitor:
    made = SilenceMonitor("DVL", "$DV sentences", STALL_S)
    made.restart(stamp_from_s(100.0))
    return made


def reported(monitor: SilenceMonitor, at_s: float) -> list[str]:
    return [one.text for one in monitor.tick(stamp_from_s(at_s))]


def test_a_line_is_well_before_anybody_has_looked() -> None:
    assert SilenceMonitor("DVL", "$DV sentences", STALL_S).condition == "well"


def test_silence_is_reported_once_and_again_after_it_was_well(monitor: SilenceMonitor) -> None:
    assert reported(monitor, 103.0) == []
    (text,) = reported(monitor, 103.1)
    assert text.startswith("DVL: no byte for 3 s, wanted $DV sentences; check power")
    assert (reported(monitor, 110.0), monitor.condition) == ([], "silent")
    monitor.last_byte = monitor.last_valid = stamp_from_s(110.5)
    assert (reported(monitor, 111.0), monitor.condition) == ([], "well")
    assert len(reported(monitor, 114.0)) == 1


def test_bytes_without_a_valid_message_are_reported_after_twice_the_time(monitor: SilenceMonitor) -> None:
    monitor.last_byte = stamp_from_s(106.0)
    assert reported(monitor, 106.0) == []
    (text,) = reported(monitor, 106.1)
    assert "bytes arrive but none of them verify, wanted $DV sentences; check line speed" in text
    assert (reported(monitor, 106.2), monitor.condition) == ([], "foreign")
    assert len(reported(monitor, 109.1)) == 1, "now it is silent as well"


def test_a_line_that_is_opened_again_begins_anew(monitor: SilenceMonitor) -> None:
    assert reported(monitor, 120.0) != []
    monitor.restart(stamp_from_s(120.0))
    assert monitor.condition == "well"
    assert reported(monitor, 123.0) == []


def test_a_measurement_that_is_late_at_the_start_suspects_no_sensor() -> None:
    made = MeasurementMonitor({Inertial: "rates", Pressure: "depth"}, 1.0)
    for at_s, remedy in ((1.0, ""), (5.0, ""), (9.0, "; check its sensor of depth")):
        made.received(Inertial((0.0, 0.0, -9.8), (0.0, 0.0, 0.0), 20.0), stamp_from_s(at_s))
        assert made.missing(stamp_from_s(at_s), "") == f"no depth yet{remedy}"


def test_a_measurement_that_does_not_come_is_named_while_the_others_do() -> None:
    made = MeasurementMonitor({Inertial: "rates", Pressure: "depth"}, 1.0)
    for at_s in (1.0, 2.0, 3.0):
        made.received(Inertial((0.0, 0.0, -9.8), (0.0, 0.0, 0.0), 20.0), stamp_from_s(at_s))
    assert made.missing(stamp_from_s(3.0), "barometer 2 is silent") == "no depth yet; barometer 2 is silent"
    made.received(Pressure(101325.0, 20.0), stamp_from_s(3.0))
    assert made.missing(stamp_from_s(3.5), "barometer 2 is silent") == ""
    made.received(Inertial((0.0, 0.0, -9.8), (0.0, 0.0, 0.0), 20.0), stamp_from_s(6.0))
    assert made.missing(stamp_from_s(6.0), "") == "no depth for 3.0 s; check its sensor of depth"
