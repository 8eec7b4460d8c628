"""Thrust that drives a motion, and thrust that answers it."""

from collections.abc import Iterator

import numpy as np
import pytest

from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.signals import IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.objections import Code
from hindrax_ident.online.record_session import RecordSession
from hindrax_ident.online.sample_verdict import NotLearned, not_learned
from hindrax_ident.records.driven import Drive, RunningDrive

STEP_S = 0.05
BOX = Vehicle("box", mass_kg=20.0, volume_m3=0.0203, envelope_m=(0.6, 0.5, 0.4))


def rolled(sign: float, hold_Nms: float, samples: int = 2400) -> Iterator[tuple[float, float, float]]:
    """Time, moment as recorded, roll rate: waves of 2 N m roll it, and a controller damps that; or sticks do."""
    rng, v = np.random.default_rng(5), 0.0
    waves = 2.0 * np.sin(0.9 * STEP_S * np.arange(samples)) + rng.normal(0.0, 0.1, samples)
    pushes = np.repeat(rng.uniform(-3.0, 3.0, samples // 40), 40) * (hold_Nms == 0.0)
    for index, (wave, push) in enumerate(zip((waves * (hold_Nms > 0.0)).tolist(), pushes.tolist(), strict=True)):
        force = push - hold_Nms * v
        yield STEP_S * index, sign * force, v + float(rng.normal(0.0, 0.003))
        v += STEP_S * (force + wave - 1.5 * v) / 0.9


@pytest.mark.parametrize(
    ("sign", "hold_Nms", "expected"),
    [
        (1.0, 0.0, Drive.DRIVES),
        (-1.0, 0.0, Drive.AGAINST),
        (1.0, 6.0, Drive.BRAKES),
        (1.0, 0.5, Drive.BRAKES),
    ],
)
def test_thrust_that_answers_a_motion_drives_it_not_and_has_no_wrong_sign(
    sign: float, hold_Nms: float, expected: Drive
) -> None:
    """A controller that damps waves pushes against the motion, a wrong sign follows it."""
    found = RunningDrive()
    for t_s, moment, v in rolled(sign, hold_Nms):
        found.thrust(t_s, moment)
        found.velocity(t_s, v)
    assert found.now is expected


def test_thrust_that_never_changes_says_nothing() -> None:
    found = RunningDrive()
    found.velocity(0.0, 0.1)
    found.thrust(0.0, 2.0)
    for index in range(200):
        found.velocity(STEP_S * index, 0.1 * np.sin(index))
    assert found.now is Drive.DRIVES


def of_roll(sign: float, hold_Nms: float) -> Iterator[Stamped[IdentEvent]]:
    for t_s, moment, v in rolled(sign, hold_Nms, 800):
        stamp = after(Stamp(1), t_s)
        yield Stamped(stamp, Thrust((0.0, 0.0, 0.0, moment, 0.0, 0.0)))
        yield Stamped(stamp, Velocity((0.0, 0.0, 0.0, v, 0.0, 0.0), "record"))


@pytest.mark.parametrize(
    ("sign", "hold_Nms", "refused", "code"),
    [
        (1.0, 6.0, NotLearned.BRAKED_BY_THRUST, Code.BRAKED_BY_THRUST),
        (-1.0, 0.0, NotLearned.AGAINST_THRUST, Code.AGAINST_THRUST),
    ],
)
def test_of_an_axis_that_is_not_driven_nothing_is_known_live_nor_after(
    sign: float, hold_Nms: float, refused: NotLearned, code: Code
) -> None:
    """The gain of the controller is no drag: -14 +- 0.2 N m s of a damper of 6 beside a drag of 1.5."""
    session = RecordSession(BOX)
    last = [*session.step(*of_roll(sign, hold_Nms))][-1].reading
    assert not last.learning
    assert last.reason == not_learned(refused)
    assert last.sigmas[1] > 1.5, "as wide as before the record"
    result = session.finalize()["roll"]
    assert not result.identifiable
    assert code in [reason.code for reason in result.reasons]


def test_what_is_driven_is_learned_from() -> None:
    session = RecordSession(BOX)
    last = [*session.step(*of_roll(1.0, 0.0))][-1].reading
    assert last.learning
    assert last.values[1] == pytest.approx(1.5, abs=3.0 * last.sigmas[1])
    assert Code.BRAKED_BY_THRUST not in [reason.code for reason in session.finalize()["roll"].reasons]
