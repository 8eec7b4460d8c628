"""A vehicle identified while it flies gets the verdict that its record gets afterwards."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_analysis.records.recording import Recording
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.signals import Attitude, IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import array
from hindrax_ident.online.record_session import RecordSession

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
STEP_S, SPAN_S = 0.05, 60.0


def record() -> Recording:
    """Surge pushed forth and back, seen with some noise; all else at rest."""
    noise = np.random.default_rng(3).normal(0.0, 0.005, round(SPAN_S / STEP_S))
    t = array(np.arange(len(noise)) * STEP_S)
    force = np.where(t % 20.0 < 10.0, 20.0, 8.0) * np.where(t % 10.0 < 5.0, 1.0, -1.0)
    speeds, speed = [], 0.0
    for one in force.tolist():
        speeds.append(speed)
        for _ in range(10):
            speed += 0.1 * STEP_S * (one - 60.0 * abs(speed) * speed - 5.0 * speed) / 25.0
    velocity, wrench = np.zeros((len(t), 6)), np.zeros((len(t), 6))
    velocity[:, 0], wrench[:, 0] = np.array(speeds) + noise, force
    tilts = np.column_stack([np.zeros((len(t), 2)), np.full(len(t), np.nan)])
    return Recording("made", t, velocity, t, wrench, t, tilts)


def measurements(recording: Recording) -> Iterator[Stamped[IdentEvent]]:
    """The record as it comes: wrenches late, as topics of another process are."""
    late: list[Stamped[IdentEvent]] = []
    for t, nu, wrench in zip(recording.velocity_t, recording.velocity, recording.wrench, strict=True):
        stamp = stamp_from_s(1e6 + float(t))
        yield Stamped(stamp, Attitude((0.0, 0.0, np.nan)))
        u, v, w, p, q, r = nu.tolist()
        yield Stamped(stamp, Velocity((u, v, w, p, q, r), "odometry"))
        X, Y, Z, K, M, N = wrench.tolist()
        late.append(Stamped(stamp, Thrust((X, Y, Z, K, M, N))))
        if len(late) > 4:
            yield late.pop(0)
    yield from late


def test_the_verdict_while_flying_is_that_over_the_record() -> None:
    recording = record()
    session = RecordSession(VEHICLE)
    estimates = [estimate for one in measurements(recording) for estimate in session.step(one)]
    assert {one.reading.motion for one in estimates} == {"surge"}
    assert session.dropped == 0
    live = session.finalize()
    task = IdentificationTask(axes=(0,))
    afterwards = identify_sources([RecordSource(Path("made"), recording)], VEHICLE, task).results.motions
    assert set(live) == set(afterwards) == {"surge"}
    one, other = live["surge"], afterwards["surge"]
    assert one.identifiable
    assert other.identifiable
    for name in ("k_q", "added_mass"):
        # The last half second still waits for its neighbors.
        assert one.coefficients[name].value == pytest.approx(other.coefficients[name].value, rel=0.02)
        assert one.coefficients[name].std == pytest.approx(other.coefficients[name].std, rel=0.1)
    assert one.coefficients["k_q"].value == pytest.approx(60.0, rel=0.1)
