"""What the fit of one axis leaves out while the vehicle is turned over about another."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from hindrax_analysis.records.recording import Recording, events
from hindrax_core.signals import Attitude, Velocity
from hindrax_ident.arrays import Array, array
from hindrax_ident.records.turned_over import is_turned_over, notes_on_turns

T = array(np.arange(0.0, 100.0, 0.5))
SURGE, ROLL, PITCH, YAW = 0, 3, 4, 5


def attitude(roll_deg: float = 0.0, pitch_deg: float = 0.0, during_s: tuple[float, float] = (40.0, 50.0)) -> Array:
    """Level but for one time."""
    over = (during_s[0] <= T) & (during_s[1] >= T)
    return array(np.column_stack([
        *(np.where(over, math.radians(angle), 0.0) for angle in (roll_deg, pitch_deg)), np.full(len(T), 3.0)
    ]))  # fmt: skip


def left_out(axis: int, tilts: Array) -> tuple[float, ...]:
    """First and last time that is left out [s]; empty without any."""
    times = T[is_turned_over(axis, T, tilts, T)]
    return (float(times[0]), float(times[-1])) if len(times) else ()


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "axes"),
    [
        (0.0, 60.0, (ROLL,)),
        (60.0, 0.0, (PITCH,)),
        (180.0, 0.0, (PITCH,)),
        (60.0, 60.0, (ROLL, PITCH)),
        (40.0, 40.0, ()),
    ],
)
def test_an_axis_loses_the_time_in_which_it_is_turned_over_about_another(
    roll_deg: float, pitch_deg: float, axes: Sequence[int]
) -> None:
    for axis in range(6):
        assert left_out(axis, attitude(roll_deg, pitch_deg)) == ((35.0, 55.0) if axis in axes else ())


def test_a_record_that_is_never_level_or_has_no_angles_loses_nothing() -> None:
    assert left_out(ROLL, attitude(0.0, 80.0, (0.0, 100.0))) == ()
    unknown = attitude(0.0, 80.0)
    unknown[:, 1] = np.nan
    assert left_out(ROLL, unknown) == ()
    nothing = array(np.zeros(0))
    assert not is_turned_over(ROLL, nothing, array(np.zeros((0, 3))), T).any()
    assert notes_on_turns(nothing, array(np.zeros((0, 3)))) == []


def test_the_motion_of_the_axis_alone_is_left_out_of_its_events() -> None:
    """Motion along the others goes on: it causes forces on those that are fitted."""
    nu = array(np.tile([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], (len(T), 1)))
    record = Recording("flown", T, nu, T, nu, T, attitude(pitch_deg=60.0))
    for axis in (SURGE, ROLL, YAW):
        found = [(one.stamp * 1e-9, one.reading) for one in events(record, axis)]
        rates = {t: reading.nu for t, reading in found if isinstance(reading, Velocity)}
        angles = [t for t, reading in found if isinstance(reading, Attitude)]
        gone = [t for t, one in rates.items() if math.isnan(one[axis])]
        assert len(rates) == len(T)
        assert all(math.isfinite(value) for one in rates.values() for value in np.delete(one, axis))
        if axis == ROLL:
            assert (min(gone), max(gone)) == (35.0, 55.0)
            assert not any(35.0 <= t <= 55.0 for t in angles)
            assert len(angles) == len(T) - len(gone)
        else:
            assert not gone


def test_a_roll_goes_on_beyond_half_a_turn_as_its_rate_does() -> None:
    tilts = attitude()
    tilts[:, 0] = np.arctan2(np.sin(0.3 * T), np.cos(0.3 * T))
    record = Recording("rolled", T, array(np.zeros((len(T), 6))), T, array(np.zeros((len(T), 6))), T, tilts)
    angles = [one.reading.attitude_rad[0] for one in events(record, ROLL) if isinstance(one.reading, Attitude)]
    assert angles == pytest.approx((0.3 * T).tolist())


def test_what_is_left_out_is_said_once_for_axes_with_the_same_times() -> None:
    assert notes_on_turns(T, attitude()) == []
    (said_once,) = notes_on_turns(T, attitude(60.0, 60.0))
    assert said_once == (
        "roll, pitch: turned over by more than 45 deg, or soon, for 20 s (one stretch, after 35 s): "
        "left out where axes are fitted one by one"
    )
    twice = attitude(roll_deg=170.0) + attitude(roll_deg=60.0, during_s=(1.0, 2.0))
    said = "for 27 s (2 stretches, the first after 0 s)"
    assert [said in one for one in notes_on_turns(T, array(twice))] == [True]
