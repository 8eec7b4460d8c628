"""What applied pulses mean: which channels are thrusters, what is no pulse, and the wrench of the rest."""

import math
import re
from dataclasses import replace

import pytest

from hindrax_control.allocation.thrust_curve import PULSE_FIELDS, AppliedWrench, check_pulses, pulses_of_channels
from hindrax_core.vehicle import Vehicle

PULSES = (1600.0, 1400.0, 1500.0, 1700.0, 1550.0, 1450.0, 1300.0, 1650.0)


def channels_of(vehicle: Vehicle) -> list[float]:
    """All output channels with these pulses on those of the thrusters, and 1111 us elsewhere."""
    channels = [1111.0] * (max(thruster.channel for thruster in vehicle.thrusters) + 1)
    for thruster, pulse in zip(vehicle.thrusters, PULSES, strict=True):
        channels[thruster.channel] = pulse
    return channels


def test_pulses_are_taken_from_the_channels_of_the_thrusters(hindrax: Vehicle) -> None:
    turned = [replace(one, channel=2 * one.channel + 1) for one in reversed(hindrax.thrusters)]
    spread = replace(hindrax, thrusters=tuple(turned))
    for vehicle in (hindrax, spread):
        assert pulses_of_channels(vehicle, channels_of(vehicle)) == list(PULSES)
        assert pulses_of_channels(vehicle, [*channels_of(vehicle), 0.0, 65535.0]) == list(PULSES)


def test_a_channel_that_is_off_stops_its_thruster(hindrax: Vehicle) -> None:
    channels = channels_of(hindrax)
    channels[hindrax.thrusters[3].channel] = 0.0
    assert pulses_of_channels(hindrax, channels) == [*PULSES[:3], 1500.0, *PULSES[4:]]


def test_too_few_channels_are_reported(hindrax: Vehicle) -> None:
    channels = channels_of(hindrax)
    with pytest.raises(ValueError, match=f"holds {len(channels) - 1} channels, wanted {len(channels)} for"):
        pulses_of_channels(hindrax, channels[:-1])
    assert pulses_of_channels(replace(hindrax, thrusters=()), []) == []


@pytest.mark.parametrize("pulse", [499.0, 2501.0, math.nan, 65535.0])
def test_what_is_no_servo_pulse_is_reported(hindrax: Vehicle, pulse: float) -> None:
    pulses = [*PULSES[:5], pulse, *PULSES[6:]]
    with pytest.raises(ValueError, match=f"found a pulse of {re.escape(f'{pulse:g}')} us"):
        check_pulses(pulses, 8)
    channels = channels_of(hindrax)
    channels[hindrax.thrusters[5].channel] = pulse
    with pytest.raises(ValueError, match="found a pulse of"):
        pulses_of_channels(hindrax, channels)


def test_servo_pulses_of_all_thrusters_are_fit_and_those_of_fewer_are_not() -> None:
    check_pulses([500.0, 2500.0, 1500.0], 3)
    with pytest.raises(ValueError, match="found 3 pulses, wanted 4"):
        check_pulses([1500.0] * 3, 4)


def test_the_wrench_of_pulses_is_force_times_arm(hindrax: Vehicle) -> None:
    applied = AppliedWrench(hindrax)
    forces_N = applied.forces_N(PULSES)
    wanted = [0.0] * 6
    for thruster, force_N in zip(hindrax.thrusters, forces_N, strict=True):
        dx, dy, dz = (force_N * share for share in thruster.direction)
        x, y, z = (p - c for p, c in zip(thruster.position_m, hindrax.center_of_mass_m, strict=True))
        parts = (dx, dy, dz, y * dz - z * dy, z * dx - x * dz, x * dy - y * dx)
        wanted = [total + part for total, part in zip(wanted, parts, strict=True)]
    assert applied.wrench(forces_N) == pytest.approx(wanted, abs=1e-9)
    assert forces_N[2] == 0.0
    assert forces_N[0] > 0.0 > forces_N[1]


def test_a_lower_supply_gives_less(hindrax: Vehicle) -> None:

    full, low = (AppliedWrench(hindrax, volts).forces_N(PULSES) for volts in (hindrax.supply_V, 12.0))
    assert AppliedWrench(hindrax).forces_N(PULSES) == full
    assert AppliedWrench(replace(hindrax, supply_V=12.0)).forces_N(PULSES) == low
    assert all(abs(less) < abs(more) for less, more in zip(low, full, strict=True) if more)


def test_pulses_may_come_from_mavros_or_as_a_plain_array() -> None:
    assert PULSE_FIELDS["mavros_msgs/msg/RCOut"] == "channels"
    assert PULSE_FIELDS["std_msgs/msg/UInt16MultiArray"] == "data"
