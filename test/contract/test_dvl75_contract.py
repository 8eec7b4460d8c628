"""The DVL-75 driver against the emulator: the truth that is set is the reading that comes out."""

import math
from collections.abc import Callable

import pytest
from contract.serial_bench import Bench, world_s
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.events import Stamp
from hindrax_core.readings import BottomTrack, BottomVelocity, Vec3
from hindrax_drivers.devices.dvl75 import Dvl75
from hindrax_drivers.devices.dvl75_settings import Dvl75Knobs, commands, wanted_settings
from hindrax_sim.devices.dvl75 import Dvl75 as Emulator
from hindrax_sim.devices.dvl75 import DvlSettings, DvlTruth

ON = DvlSettings(deltas=True)


def bench(
    truth: Callable[[float], DvlTruth],
    *,
    knobs: Dvl75Knobs | None = None,
    settings: DvlSettings = ON,
    noise_mps: float = 0.0,
) -> Bench[Dvl75]:
    return Bench(Dvl75(knobs or Dvl75Knobs()), Emulator(settings=settings, noise_mps=noise_mps), truth)


def forward_mps(reading: BottomVelocity) -> float:
    assert reading.velocity_mps is not None
    return reading.velocity_mps[0]


SPEED = st.floats(-1.0, 1.0)
ANGLE = st.floats(-0.6, 0.6)


@settings(max_examples=15, deadline=None)
@given(st.tuples(SPEED, SPEED, SPEED), st.tuples(ANGLE, ANGLE, st.floats(0.0, 6.28)), st.floats(0.1, 14.0))
def test_velocity_attitude_and_altitude_come_through_within_one_step(
    velocity: Vec3, attitude: Vec3, altitude: float
) -> None:
    log = bench(lambda _: DvlTruth(velocity, attitude, altitude)).run(2.0)
    step_mps = 0.0005 / 0.05 + 1e-4  # half a millimetre per interval, and a clock 40 ppm fast
    locked = [one.reading for one in log.of(BottomVelocity, 1.2)]
    assert len(locked) >= 14
    for reading in locked:
        assert reading.velocity_mps == pytest.approx(velocity, abs=step_mps)
    for stamped in log.of(BottomTrack, 1.2):
        track = stamped.reading
        assert track.locked
        assert track.altitude_m == pytest.approx(altitude, abs=0.0051)
        assert (track.roll_rad, track.pitch_rad) == pytest.approx(attitude[:2], abs=math.radians(0.051))
        assert abs(math.remainder(track.heading_rad - attitude[2], math.tau)) <= math.radians(0.051)
    assert log.rejected == []


def test_a_mean_velocity_is_true_at_its_stamp_while_the_vehicle_accelerates() -> None:
    def truth(now_s: float) -> DvlTruth:
        return DvlTruth((0.3 * math.sin(now_s), 0.2 * math.cos(now_s), 0.0))

    log = bench(truth).run(20.0)
    for stamped in log.of(BottomVelocity, 2.0):
        at = world_s(stamped)
        assert stamped.reading.velocity_mps == pytest.approx(truth(at).velocity_mps, abs=0.0115)


def test_travel_given_as_a_sum_gives_the_same_as_velocity() -> None:
    def summed(now_s: float) -> DvlTruth:
        return DvlTruth((0.3, 0.0, -0.1), travel_m=(0.3 * now_s, 0.0, -0.1 * now_s))

    by_sum = [one.reading for one in bench(summed).run(5.0).of(BottomVelocity)]
    by_speed = [one.reading for one in bench(lambda _: DvlTruth((0.3, 0.0, -0.1))).run(5.0).of(BottomVelocity)]
    assert [one.velocity_mps for one in by_sum] == [one.velocity_mps for one in by_speed]


def test_sigma_is_honest() -> None:
    """The spread of the errors is what the driver says it is, within what 600 samples can tell."""
    log = bench(
        lambda now_s: DvlTruth((0.3 * math.sin(0.37 * now_s), 0.1, 0.0)),
        knobs=Dvl75Knobs(sigma_floor_mps=0.01),
        noise_mps=0.01,
    ).run(32.0)
    found = log.of(BottomVelocity, 2.0)
    errors = [forward_mps(one.reading) - 0.3 * math.sin(0.37 * world_s(one)) for one in found]
    spread = math.sqrt(sum(error * error for error in errors) / len(errors))
    assert spread == pytest.approx(found[0].reading.sigma_mps, rel=0.1)


@pytest.mark.parametrize(("altitude", "count"), [(2.0, 100), (20.0, 50), (50.0, 25)])
def test_the_rate_follows_the_altitude(altitude: float, count: int) -> None:
    log = bench(lambda _: DvlTruth(altitude_m=altitude)).run(10.0)
    assert len(log.of(BottomVelocity, 5.0)) == pytest.approx(count, abs=1)


def test_there_is_never_a_velocity_without_lock() -> None:
    def truth(now_s: float) -> DvlTruth:
        silent = 4.0 <= now_s < 6.0
        return DvlTruth((0.5, 0.0, 0.0), altitude_m=None if silent else 2.0)

    log = bench(truth).run(10.0)
    assert all(one.reading.velocity_mps is None for one in log.of(BottomVelocity, 4.2, 6.0))
    assert len(log.of(BottomVelocity, 4.2, 6.0)) >= 15
    assert all(not one.reading.locked and one.reading.altitude_m is None for one in log.of(BottomTrack, 4.2, 6.0))
    assert all(forward_mps(one.reading) == pytest.approx(0.5, abs=0.011) for one in log.of(BottomVelocity, 7.0))


def test_a_device_fresh_from_the_factory_is_made_to_send_deltas() -> None:
    log = bench(lambda _: DvlTruth((0.1, 0.0, 0.0)), settings=DvlSettings()).run(4.0)
    assert [one.data for _, one in log.sends] == [b"\nCONFIGURATION\n", b"SEND-DVPDL ON\n"]
    assert len(log.of(BottomVelocity, 3.0)) >= 19
    assert log.identities[-1][1].text == "Cerulean DVL-75, firmware Oct 1 2021"


def test_setup_changes_what_differs_and_then_nothing_more() -> None:
    line = bench(lambda _: DvlTruth(), settings=DvlSettings(speed_of_sound_mps=1500.0))
    line.run(1.0)
    settled = wanted_settings(Dvl75Knobs())
    wanted = commands(line.driver.configuration, settled)
    assert wanted == (b"SEND-DVPDL ON\n", b"SET-SPEED-OF-SOUND 1484.0\n")
    for command in wanted:
        line.emulator.receive(command, line.now_s)
    line.driver.feed(line.emulator.receive(b"?\n", line.now_s), Stamp(0))
    assert commands(line.driver.configuration, settled) == ()


def test_a_wrong_speed_of_sound_scales_the_velocity() -> None:
    log = bench(lambda _: DvlTruth((0.5, 0.0, 0.0), speed_of_sound_mps=1500.0), settings=DvlSettings(deltas=True)).run(
        3.0
    )
    speeds = [forward_mps(one.reading) for one in log.of(BottomVelocity, 1.5)]
    assert sum(speeds) / len(speeds) == pytest.approx(0.5 * 1484.0 / 1500.0, abs=0.01)


def test_the_clock_map_does_not_drift_away() -> None:
    line = Bench(Dvl75(), Emulator(settings=ON, drift_ppm=180.0, noise_mps=0.0), lambda _: DvlTruth())
    log = line.run(120.0)
    late = [at - world_s(one) for at, one in log.readings if isinstance(one.reading, BottomVelocity) and at > 100.0]
    assert max(late) - min(late) < 0.0051  # the world's step is 5 ms
    assert min(late) > 0.025
    assert max(late) < 0.042
