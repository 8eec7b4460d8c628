"""Messages of the thrust that were lost: a change within them came at a time that nobody knows."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from hindrax_core.events import Stamp, seconds_between
from hindrax_core.signals import Thrust
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.objections import CAUSES
from hindrax_ident.assess.results import truth_of
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.online.session import Session
from hindrax_ident.records.axis_record import Series, changed_unseen
from hindrax_ident.records.feed import Feed
from hindrax_ident.testing.synthetic_runs import Plan, events, fly, sensors_of

PERIOD_S, HELD_S = 0.02, 4.0
LEVELS = tuple(part for size in (0.6, 1.2, 2.8) for part in (size, 0.0, -size, 0.0)) * 2


def test_a_flight_of_which_messages_were_lost_is_as_right_as_one_that_is_whole(vehicle: Vehicle) -> None:
    """Six pauses of 0.9 s with a change in each: the drag was 5 % too high, and known to 6 to 15 % in place of 3."""
    truth, model = truth_of(vehicle)["yaw"], model_of(vehicle, 5)
    theta = array(np.array([truth["k_q"], truth["k_l"], truth["b"], model.rigid + truth["added_mass"]]))
    t = array(np.arange(0.0, HELD_S * len(LEVELS), PERIOD_S))
    forces = array(np.repeat(LEVELS, round(HELD_S / PERIOD_S)))
    flight = fly(model, theta, Plan(t, forces, HELD_S * len(LEVELS)), 0.15)
    rng = np.random.default_rng(1)
    begins_s = [HELD_S * k - rng.uniform(0.3, 0.8) for k in (1, 5, 9, 13, 17, 21)]
    session = Session(vehicle, every_s=math.inf)
    for event in Feed(vehicle, session.tuning).all(events(flight, 5, "yaw", sensors_of(5), rng)):
        at_s = seconds_between(Stamp(0), event.stamp)
        if not (isinstance(event.reading, Thrust) and any(begin_s < at_s < begin_s + 0.9 for begin_s in begins_s)):
            session.step(event)
    yaw = session.finalize().results.motions["yaw"]
    assert yaw.identifiable
    assert yaw.drag is not None
    top = float(yaw.drag.speed[-1])
    true = theta[0] * top**2 + theta[1] * top
    assert yaw.drag.force[-1] == pytest.approx(true, rel=0.02)
    assert yaw.drag.std_calibrated[-1] < 0.045 * true
    assert not [one for one in yaw.warnings if one.code in CAUSES]


@pytest.mark.parametrize(
    ("times_s", "forces", "lost"),
    [
        ((0.0, 0.1, 0.2, 1.1, 1.2), (1.0, 1.0, 1.0, 2.0, 2.0), [2]),
        ((0.0, 0.1, 0.2, 1.1, 1.2), (1.0, 1.0, 1.0, 1.0, 2.0), []),
        ((0.0, 0.1, 0.2, 1.1, 1.2), (1.0, 1.0, 0.0, 2.0, 2.0), []),
        ((0.0, 0.1, 0.2, 1.1, 1.2), (1.0, 1.1, 1.2, 2.0, 2.1), []),
        ((0.0, 1.0, 2.0, 4.0, 5.0), (1.0, 1.0, 1.0, 2.0, 2.0), []),
        ((0.0,), (1.0,), []),
    ],
    ids=["a change in a pause", "no change", "at rest before", "sent when it changes", "a slow sender", "one alone"],
)
def test_only_a_change_in_a_pause_of_who_sends_at_a_rate_is_unknown(
    times_s: Sequence[float], forces: Sequence[float], lost: list[int]
) -> None:
    assert np.flatnonzero(changed_unseen(Series(array(times_s), array(forces)))).tolist() == lost
