"""The Ping1D driver against the emulator: the truth that is set is the reading that comes out."""

import math
from collections.abc import Callable

import pytest
from contract.serial_bench import Bench, world_s
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.readings import Echo, EchoProfile, SonarHealth
from hindrax_drivers.devices.ping1d import Ping1d
from hindrax_drivers.devices.ping1d_settings import DEFAULT_KNOBS, Ping1dKnobs
from hindrax_sim.devices.ping1d import Ping1d as Emulator
from hindrax_sim.devices.ping1d import PingTruth


def bench(truth: Callable[[float], PingTruth], noise: float = 0.0, knobs: Ping1dKnobs = DEFAULT_KNOBS) -> Bench[Ping1d]:
    return Bench(Ping1d(knobs), Emulator(noise=noise), truth)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.3, 4.9), st.booleans(), st.booleans())
def test_the_distance_comes_through_within_one_step(distance: float, auto: bool, continuous: bool) -> None:
    log = bench(
        lambda _: PingTruth(distance), knobs=Ping1dKnobs(mode_auto=auto, continuous=continuous, profile=True)
    ).run(3.0)
    echoes = [one.reading for one in log.of(Echo, 1.5)]
    assert len(echoes) >= 10
    for echo in echoes:
        assert echo.range_m == pytest.approx(distance, abs=0.00051)
        assert echo.confidence == 1.0
    assert log.rejected == []
    assert log.troubles == []


def test_a_profile_shows_its_peak_at_the_distance() -> None:
    line = bench(lambda _: PingTruth(2.0), knobs=Ping1dKnobs(mode_auto=False, range_start_m=0.0, range_length_m=5.0))
    log = line.run(2.0)
    assert not log.of(EchoProfile)
    line._handle(line.driver.request_profile())
    profiles = [one.reading for one in line.run(0.5).of(EchoProfile)]
    assert len(profiles) == 1
    assert profiles[0].strength.index(max(profiles[0].strength)) == 80
    assert (profiles[0].start_m, profiles[0].length_m) == (0.0, 5.0)


def test_an_echo_is_true_at_its_stamp_while_the_bottom_comes_nearer() -> None:
    def truth(now_s: float) -> PingTruth:
        return PingTruth(3.0 - 0.2 * now_s)

    log = bench(truth, knobs=Ping1dKnobs(speed_of_sound_mps=1484.0)).run(8.0)
    for stamped in log.of(Echo, 2.0):
        # The emulator looks at the truth at the end of the scan: 0.2 m/s for at most 20 ms and two steps.
        assert stamped.reading.range_m == pytest.approx(truth(world_s(stamped)).distance_m, abs=0.006)


def test_noise_is_half_a_percent() -> None:
    log = bench(lambda _: PingTruth(4.0), noise=0.005, knobs=Ping1dKnobs(mode_auto=False)).run(30.0)
    errors = [one.reading.range_m / 4.0 - 1.0 for one in log.of(Echo, 2.0)]
    assert math.sqrt(sum(error * error for error in errors) / len(errors)) == pytest.approx(0.005, rel=0.15)


def test_a_doubtful_echo_is_refused() -> None:
    log = bench(lambda now_s: PingTruth(2.0, confidence=0.3 if now_s > 3.0 else 0.9)).run(5.0)
    assert log.of(Echo, 2.0, 3.0)
    assert not log.of(Echo, 3.2)
    assert {one.partition(" %")[0] for one in log.reasons()} == {"distance: confidence 30"}


@pytest.mark.parametrize("continuous", [True, False])
def test_without_an_echo_there_is_no_reading_and_with_one_there_is_again(continuous: bool) -> None:
    log = bench(
        lambda now_s: PingTruth(None if 3.0 < now_s < 6.0 else 2.0), knobs=Ping1dKnobs(continuous=continuous)
    ).run(9.0)
    assert not log.of(Echo, 3.2, 6.0)
    assert len(log.of(Echo, 7.0)) >= 10
    assert log.troubles == []


def test_the_speed_of_sound_is_set() -> None:
    line = bench(lambda _: PingTruth(3.0, speed_of_sound_mps=1520.0), knobs=Ping1dKnobs(speed_of_sound_mps=1520.0))
    assert line.run(2.0).of(Echo)[-1].reading.range_m == pytest.approx(3.0, abs=0.001)


def test_readings_are_ordered_and_new() -> None:
    log = bench(lambda _: PingTruth(2.0), knobs=Ping1dKnobs(continuous=False, interval_s=0.05)).run(10.0)
    numbers = [one.reading.ping_number for one in log.of(Echo)]
    assert numbers == sorted(set(numbers))
    stamps = [one.stamp for one in log.of(Echo)]
    assert stamps == sorted(stamps)


def test_a_sonar_that_refuses_to_stream_is_polled_at_the_same_rate() -> None:
    line = Bench(Ping1d(Ping1dKnobs()), Emulator(noise=0.0, continuous=False), lambda _: PingTruth(2.0))
    log = line.run(5.0)
    assert len(log.of(Echo, 2.0)) >= 50
    assert [one.text for _, one in log.troubles] == ["Ping: continuous start refused (bad value)"]


def test_a_supply_out_of_its_range_is_reported() -> None:
    line = Bench(Ping1d(Ping1dKnobs()), Emulator(supply_V=4.2), lambda _: PingTruth(2.0))
    log = line.run(12.0)
    assert [one.reading.supply_V for one in log.of(SonarHealth)] == pytest.approx([4.2, 4.2])
    assert [one.text.split(";")[0] for _, one in log.troubles] == ["Ping: supply 4.20 V, wanted 4.5 to 5.5 V"]
