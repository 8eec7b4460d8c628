"""The experiment: every motion once, then what informs most per second, until enough is known or the time is over."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.plateaus import Plateaus
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.aim import FIRST, Aim, Choice, check_experiment, plan_text
from hindrax_ident.online.experiment import CONTENT_SHARE, DragEstimate, Experiment, drag_of
from hindrax_ident.online.session import Session

MODEL = Model(0, 20.0)
PACE_S = 50.0


def rows(speeds: Sequence[float]) -> Array:
    """Regressors of plateaus out and back at each speed: |v| v, v and 1."""
    v = array([sign * speed for speed in speeds for sign in (1.0, -1.0)])
    return np.stack([np.abs(v) * v, v, np.ones_like(v)], axis=1)


def drag(noise: float, speeds: Sequence[float] = (0.45, 0.1), seconds: float = 10.0) -> DragEstimate:
    """Plateaus of equal length; `noise` of the drag where it is largest, in units of what is wanted."""
    x, top = rows(speeds), max(speeds)
    gradient = array([[share**2 * top**2, share * top, 0.0] for share in (0.5, 1.0)])
    unit = np.linalg.inv(seconds * x.T @ x)
    largest = float(np.sum(gradient @ unit * gradient, axis=1).max())
    plateaus = Plateaus(x[:, 1], x[:, 0], np.full(len(x), seconds))
    return DragEstimate(MODEL, plateaus, array(unit / largest * noise**2), gradient, np.ones(2), wanted=1.0)


class Pool:
    """Flies what is chosen, `PACE_S` each; what is known of a motion grows with every time that it is flown."""

    def __init__(self, vehicle: Vehicle, known: Mapping[str, DragEstimate | None], aim: Aim) -> None:
        self.known, self.count = known, dict.fromkeys(known, 0)
        self.experiment = Experiment(tuple(known), aim, self.estimate_drag)
        session = Session(vehicle)
        self.chosen: list[Choice] = []
        for index in itertools.count():
            choice = self.experiment.next(session, 1000.0 + PACE_S * index)
            if choice is None:
                break
            self.chosen.append(choice)
            self.count[choice.motion] += 1
            assert index < 200

    def estimate_drag(self, _session: Session, axis: int, _until: float | None) -> DragEstimate | None:
        one, flown = self.known[AXES[axis]], self.count[AXES[axis]]
        return replace(one, covariance=array(one.covariance / flown)) if one and flown else None


def test_every_motion_is_flown_once_at_its_extremes_and_no_more_where_that_is_enough(vehicle: Vehicle) -> None:
    pool = Pool(vehicle, {"yaw": drag(0.5), "surge": drag(0.8)}, Aim())
    assert pool.chosen == [Choice("yaw", FIRST), Choice("surge", FIRST)]
    assert pool.experiment.ended == "every motion has reached the wanted uncertainty"
    found = {motion: one.noise for motion, one in pool.experiment.known.items()}
    assert found == pytest.approx({"yaw": 0.5, "surge": 0.8})


def test_what_is_not_known_well_enough_is_flown_again_until_it_is(vehicle: Vehicle) -> None:
    pool = Pool(vehicle, {"surge": drag(0.5), "pitch": drag(1.4)}, Aim(until=0.01))
    # A noise of 1.4 falls below 0.85 when it has been flown three times.
    assert pool.count == {"surge": 1, "pitch": 3}
    assert all(len(choice.levels) == 1 for choice in pool.chosen[2:])


def test_what_lacks_most_comes_next(vehicle: Vehicle) -> None:
    pool = Pool(vehicle, {"surge": drag(3.0), "pitch": drag(9.0)}, Aim(until=0.01))
    assert pool.chosen[2].motion == "pitch"


@pytest.mark.parametrize("speeds", [(0.45, 0.1), (0.45, 0.4), (0.45, 0.1, 0.1, 0.1)])
def test_the_gain_of_a_leg_is_that_of_the_least_squares_with_it(speeds: tuple[float, ...]) -> None:
    known = drag(3.0, speeds)
    for level, speed in ((1.0, max(speeds)), (0.0, min(speeds)), (0.5, 0.5 * (max(speeds) + min(speeds)))):
        gain, seconds, times = known.after(level)
        with_it = np.vstack([rows(speeds), rows((speed,))])

        # Independent: the covariance of a fit by QR of all rows, against that without the leg.
        def spread(x: Array) -> Array:
            found: Array = np.sum(np.linalg.solve(np.linalg.qr(x)[1].T, known.gradient.T) ** 2, axis=0)
            return found

        now = np.sum(known.gradient @ known.covariance * known.gradient, axis=1)
        after = now * spread(with_it) / spread(rows(speeds))
        assert gain == pytest.approx(
            np.sum(np.maximum(now, CONTENT_SHARE**2) - np.maximum(after, CONTENT_SHARE**2)), rel=1e-6
        )
        assert (seconds, times) == pytest.approx((20.0, 1))


def test_short_plateaus_are_flown_several_times_in_one_go() -> None:
    _, seconds, times = drag(3.0, seconds=1.5).after(1.0)
    assert (seconds, times) == pytest.approx((12.0, 4))
    assert drag(3.0, seconds=0.01).after(1.0)[2] == 6


def test_time_ends_it_and_shows_of_what_more_was_wanted(vehicle: Vehicle) -> None:
    pool = Pool(vehicle, {"surge": drag(100.0), "yaw": drag(0.5)}, Aim(minutes=6.0))
    assert 3 < len(pool.chosen) <= 360.0 / PACE_S
    assert pool.experiment.ended == "6 minutes leave no time for another leg; more was wanted of surge"


def test_short_time_shows_what_was_not_flown(vehicle: Vehicle) -> None:
    pool = Pool(vehicle, {"surge": drag(0.5), "sway": drag(0.5), "yaw": drag(0.5)}, Aim(minutes=1.5))
    assert [choice.motion for choice in pool.chosen] == ["surge", "sway"]
    assert pool.experiment.ended == "1.5 minutes are over before yaw"
    assert pool.experiment.left_s(1000.0 + 60.0) == pytest.approx(30.0)


def test_a_motion_of_which_nothing_was_learned_is_not_called_known(vehicle: Vehicle) -> None:
    pool = Pool(vehicle, {"surge": drag(0.5), "sway": None}, Aim())
    assert len(pool.chosen) == 2
    assert pool.experiment.ended.endswith("more was wanted of sway")


def test_nothing_is_known_of_an_axis_that_was_not_flown(vehicle: Vehicle) -> None:
    assert drag_of(Session(vehicle), 0, 0.0) is None


def test_the_plan_states_what_comes_first_and_when_it_ends() -> None:
    assert plan_text(("surge", "yaw"), Aim(0.02, 5.0)) == (
        "surge: fastest, slowest, fastest; yaw: fastest, slowest, fastest, each out and back; then most informative, "
        "until the noise of the drag is below 2 %, at most 5 minutes"
    )
    assert "below a third of the calibration uncertainty, at most 50 minutes" in plan_text(("yaw",), Aim())


@pytest.mark.parametrize(
    ("motions", "aim", "sentence"),
    [
        ((), Aim(), "no motion, wanted some of surge"),
        (("surge", "loop"), Aim(), "motion 'loop' unknown, wanted one of surge"),
        (("surge", "surge"), Aim(), "one of them twice, wanted each once"),
        (("surge",), Aim(until=-0.1), "until -0.1, wanted 0.0001 to 1"),
        (("surge",), Aim(until=float("nan")), "until nan, wanted"),
        (("surge",), Aim(until=1e-300), "until 1e-300, wanted"),
        (("surge",), Aim(minutes=-1.0), "minutes -1, wanted more than 0, at most 50"),
        (("surge",), Aim(minutes=float("inf")), "minutes inf, wanted"),
        (("surge",), Aim(minutes=float("nan")), "minutes nan, wanted"),
    ],
)
def test_hostile_values_are_refused_with_what_was_found_and_wanted(
    motions: tuple[str, ...], aim: Aim, sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence):
        check_experiment(motions, aim)
