"""A voltage counts while it is measured; a sensor that falls silent is named, and the constant takes its place."""

import math

import pytest

from hindrax_control.allocation.allocation_cycle import SupplyKnobs, SupplyVoltage
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.text.refusals import Reason


def at(seconds: float) -> Stamp:
    return stamp_from_s(seconds)


@pytest.fixture
def supply() -> SupplyVoltage:
    return SupplyVoltage(14.8, SupplyKnobs(silent_s=10.0))


def test_without_a_sensor_the_constant_is_marked_as_assumed(supply: SupplyVoltage) -> None:
    assert supply.measured_V(at(100.0)) is None
    assert supply.status_text(at(100.0)) == "14.8 (assumed, no battery sensor)"
    assert supply.silence_warning(at(100.0)) == ""


def test_a_measurement_counts_until_it_is_stale(supply: SupplyVoltage) -> None:
    supply.update(13.26, at(5.0))
    assert supply.measured_V(at(15.0)) == 13.3
    assert supply.status_text(at(15.0)) == "13.3 (measured)"
    assert supply.measured_V(at(15.1)) is None
    assert supply.status_text(at(17.0)) == "14.8 (assumed, the battery sensor is silent)"
    assert supply.silence_warning(at(17.0)) == "battery sensor silent for 12 s: using 14.8 V"


def test_a_knob_that_is_set_in_flight_counts_at_once(supply: SupplyVoltage) -> None:
    supply.update(13.0, at(0.0))
    assert supply.measured_V(at(8.0)) == 13.0
    supply.tune(SupplyKnobs(silent_s=5.0))
    assert supply.measured_V(at(8.0)) is None


def test_how_long_a_measurement_counts_is_a_knob() -> None:
    for supply, counts_s in ((SupplyVoltage(14.8), 10.0), (SupplyVoltage(14.8, SupplyKnobs(silent_s=5.0)), 5.0)):
        supply.update(13.0, at(0.0))
        assert [supply.measured_V(at(seconds)) for seconds in (counts_s, counts_s + 0.1)] == [13.0, None]


@pytest.mark.parametrize("voltage", [0.0, 0.4, 3.6])
def test_a_supply_that_was_measured_and_reads_nothing_is_dead_and_not_unwired(
    supply: SupplyVoltage, voltage: float
) -> None:
    for tenth in range(20):
        supply.update(voltage, at(0.1 * tenth))
    assert math.isnan(supply.battery_V(at(2.0))), "an unwired sensor states nothing"
    supply.update(14.5, at(3.0))
    supply.update(voltage, at(3.1))
    assert supply.battery_V(at(3.2)) == 14.5, "one sample may be wrong"
    for tenth in range(32, 38):
        supply.update(voltage, at(0.1 * tenth))
    assert supply.battery_V(at(3.8)) == voltage
    assert supply.status_text(at(3.8)) == f"{voltage:.1f} (measured: dead)"
    supply.update(14.4, at(4.0))
    assert supply.battery_V(at(4.0)) == 14.4


def test_a_sensor_that_speaks_again_is_accepted_again(supply: SupplyVoltage) -> None:
    supply.update(13.0, at(0.0))
    assert supply.measured_V(at(60.0)) is None
    supply.update(12.5, at(60.0))
    assert supply.measured_V(at(61.0)) == 12.5
    assert supply.silence_warning(at(61.0)) == ""


@pytest.mark.parametrize("voltage", [math.nan, math.inf, 0.0, -1.0])
def test_what_is_no_voltage_states_nothing(supply: SupplyVoltage, voltage: float) -> None:
    supply.update(voltage, at(0.0))
    assert supply.measured_V(at(1.0)) is None
    supply.update(13.0, at(2.0))
    supply.update(voltage, at(11.0))
    assert supply.measured_V(at(13.0)) is None


@pytest.mark.parametrize(
    ("voltage", "reason"),
    [
        (3.7, Reason.NONE),
        (29.6, Reason.NONE),
        (0.0, Reason.NONE),
        (3.6, Reason.IMPOSSIBLE),
        (29.7, Reason.IMPOSSIBLE),
        (1.0, Reason.IMPOSSIBLE),
    ],
)
def test_what_cannot_be_the_supply_is_refused(supply: SupplyVoltage, voltage: float, reason: Reason) -> None:
    assert supply.update(voltage, at(0.0)).reason is reason
