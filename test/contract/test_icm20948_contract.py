"""The ICM-20948 driver against the emulator: truth in, the same truth out, at the time at which it was true."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from register_rig import START, Rig, identities, readings, reasons

from hindrax_core.bus_operations import EDGES
from hindrax_core.events import seconds_between
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Inertial, Magnetic, Vec3
from hindrax_drivers.devices.icm20948 import SILENT_LINE, Icm20948
from hindrax_drivers.devices.imu.icm20948_samples import Icm20948Knobs
from hindrax_drivers.devices.imu.icm20948_selftest import SelfTest, self_test
from hindrax_sim.devices.emulator import RegisterEmulator
from hindrax_sim.devices.icm20948 import Icm20948 as Emulator
from hindrax_sim.devices.imu.imu_signal import ImuTruth, SensorErrors

NOISE = 0.2
FAITHFUL = SensorErrors(noise=NOISE)
"""Less noise than usual, but some: samples that are exactly equal are what a hung converter gives."""
FORCE_TOLERANCE_mps2 = 0.5 * GRAVITY_mps2 / 8192 + 6 * NOISE * 230e-6 * GRAVITY_mps2 * math.sqrt(math.pi / 2 * 50.4)
RATE_TOLERANCE_radps = math.radians(0.5 / 65.5 + 6 * NOISE * 0.015 * math.sqrt(math.pi / 2 * 51.2))

LEVEL = ImuTruth()
Motion = Callable[[float], ImuTruth]


def rig(motion: Motion, part: SensorErrors = FAITHFUL, knobs: Icm20948Knobs | None = None, seed: int = 0) -> Rig:
    emulator = Emulator(seed, part)
    driver = Icm20948(knobs or Icm20948Knobs())
    ports: dict[int, RegisterEmulator] = {0x68: emulator, 0x0C: emulator.magnetometer}
    return Rig(driver, ports, lambda elapsed_s, now_s: emulator.set_truth(motion(elapsed_s), now_s))


def turning(elapsed_s: float) -> ImuTruth:
    """Swings about x once in 2 s, with up to 1 rad/s."""
    return ImuTruth(rate_radps=(math.sin(math.pi * elapsed_s), 0.0, 0.0))


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    st.tuples(*[st.floats(-8.0, 8.0)] * 3),
    st.tuples(*[st.floats(-500e-6, 500e-6)] * 3),
    st.floats(-20.0, 60.0),
)
def test_a_still_truth_is_read_within_a_step(force: Vec3, rate: Vec3, field: Vec3, temperature_C: float) -> None:
    bench = rig(lambda _: ImuTruth(force, rate, field, temperature_C))
    outputs = bench.run(0.4)
    inertial, magnetic = readings(outputs, Inertial), readings(outputs, Magnetic)
    assert len(inertial) > 30
    assert len(magnetic) >= 4
    assert not reasons(outputs)
    for one in inertial:
        assert one.reading.specific_force_mps2 == pytest.approx(force, abs=FORCE_TOLERANCE_mps2)
        assert one.reading.rate_radps == pytest.approx(rate, abs=RATE_TOLERANCE_radps)
        assert one.reading.temperature_C == pytest.approx(temperature_C, abs=0.5 / 333.87 + 1e-9)
    for one in magnetic:
        assert one.reading.field_T == pytest.approx(field, abs=(0.5 + 6 * NOISE * 2.0) * 0.15e-6)


@pytest.mark.parametrize("rates", Icm20948Knobs.__dataclass_fields__["gyro_range_dps"].metadata["hindrax"].choices)
@pytest.mark.parametrize("forces", Icm20948Knobs.__dataclass_fields__["accel_range_g"].metadata["hindrax"].choices)
def test_every_range_gives_the_same_truth(rates: str, forces: str) -> None:
    truth = ImuTruth((3.0, -4.0, 9.0), (1.0, -2.0, 3.0))
    knobs = Icm20948Knobs(gyro_range_dps=rates, accel_range_g=forces)
    outputs = readings(rig(lambda _: truth, knobs=knobs).run(0.3), Inertial)
    assert outputs[-1].reading.specific_force_mps2 == pytest.approx(truth.specific_force_mps2, abs=0.01)
    assert outputs[-1].reading.rate_radps == pytest.approx(truth.rate_radps, abs=0.002)


def test_no_sample_is_missed_and_stamps_are_those_of_the_sample_clock() -> None:
    part = SensorErrors(clock_error=0.012, noise=NOISE)
    outputs = rig(lambda _: LEVEL, part).run(30.0)
    stamps = [one.stamp for one in readings(outputs, Inertial)]
    assert not reasons(outputs)
    errors = np.abs(np.diff(np.array(stamps[1500:])) / 1e9 - 1.012 / 225.0)
    assert np.quantile(errors, 0.999) < 20e-6
    assert errors.max() < 0.003  # where the map is fitted anew
    assert len(stamps) - 1 == pytest.approx(seconds_between(stamps[0], stamps[-1]) * 225.0 / 1.012, abs=2)


@pytest.mark.parametrize("filter_config", [3, 5])
def test_the_stamp_is_the_time_at_which_the_motion_was_so(filter_config: int) -> None:
    part = SensorErrors(clock_error=0.004, noise=NOISE)
    outputs = readings(rig(turning, part, Icm20948Knobs(filter=filter_config)).run(20.0), Inertial)[2000:]
    time = np.array([seconds_between(START, one.stamp) for one in outputs])
    rate = np.array([one.reading.rate_radps[0] for one in outputs])
    (sine, cosine), *_ = np.linalg.lstsq(
        np.column_stack([np.sin(np.pi * time), np.cos(np.pi * time)]), rate, rcond=None
    )
    assert math.hypot(sine, cosine) == pytest.approx(1.0, abs=2e-3)
    late_s = math.atan2(cosine, sine) / math.pi
    assert abs(late_s) < 0.001


def test_noise_and_offsets_are_those_of_the_data_sheet() -> None:
    spreads = []
    for seed in range(3):
        emulator = Emulator(seed)
        bench = Rig(
            Icm20948(Icm20948Knobs()),
            {0x68: emulator, 0x0C: emulator.magnetometer},
            lambda _, now_s, emulator=emulator: emulator.set_truth(LEVEL, now_s),  # type: ignore[misc]
        )
        rates = np.array([one.reading.rate_radps for one in readings(bench.run(4.0), Inertial)])
        assert np.abs(rates.mean(axis=0)).max() < math.radians(10.0)
        spreads.append(rates.std(axis=0).mean())
    wanted = math.radians(0.015) * math.sqrt(math.pi / 2 * 51.2)
    assert np.mean(spreads) == pytest.approx(wanted, rel=0.1)


def test_the_offset_of_the_gyroscope_is_left_to_the_navigator() -> None:
    part = SensorErrors(gyro_offset_radps=(0.02, -0.03, 0.01))
    outputs = rig(lambda _: LEVEL, part).run(6.0)
    for some in (readings(outputs, Inertial)[:400], readings(outputs, Inertial)[-400:]):
        mean = np.array([one.reading.rate_radps for one in some]).mean(axis=0)
        assert mean == pytest.approx(part.gyro_offset_radps, abs=0.0006)


def test_the_plain_register_mode_reads_the_same_truth() -> None:
    knobs = Icm20948Knobs(mode="burst", magnetometer=False)
    outputs = rig(turning, knobs=knobs).run(3.0)
    assert len(readings(outputs, Inertial)) > 400
    for one in readings(outputs, Inertial):
        wanted = math.sin(math.pi * seconds_between(START, one.stamp))
        assert one.reading.rate_radps[0] == pytest.approx(wanted, abs=0.02)


def test_a_late_host_loses_nothing_and_a_very_late_one_reports_it() -> None:
    bench = rig(lambda _: LEVEL)
    bench.run(1.0)
    bench.sleep(0.12)
    late = bench.run(0.2)
    assert not reasons(late)
    assert len(readings(late, Inertial)) == pytest.approx(225 * 0.32, abs=5)
    bench.sleep(0.4)
    assert any("overflow" in reason for reason in reasons(bench.run(0.3)))
    assert readings(bench.run(0.1), Inertial)


def test_the_part_is_known_by_its_identity() -> None:
    (identity,) = identities(rig(lambda _: LEVEL).run(0.3))
    assert identity == "ICM-20948 at 0x68, AK09916, 225 Hz, 500 dps, 4 g"


def outcome(part: Emulator) -> SelfTest:
    """A self test on a part that has been configured, and whose schedule runs no more."""
    bench = Rig(
        Icm20948(Icm20948Knobs()),
        {0x68: part, 0x0C: part.magnetometer},
        lambda _, now_s: part.set_truth(LEVEL, now_s),
    )
    bench.run(0.3)
    return bench.alone(self_test())


def test_the_self_test_passes_on_a_good_part_and_fails_on_a_bad_one() -> None:
    good = outcome(Emulator(4))
    assert good.passed, str(good)
    assert good.gyro + good.accel == pytest.approx([1.0] * 6, abs=0.02)
    assert good.mag == (0, 0, -500)
    weak = Emulator(4)
    weak.compass.hung = True
    assert not outcome(weak).passed
    assert outcome(weak).gyro == pytest.approx([1.0] * 3, abs=0.02)
    broken = Emulator(4)
    broken.hang(True)
    bad = outcome(broken)
    assert not bad.passed
    assert str(bad).startswith("self test failed: response of the gyroscope 0%")


def test_a_die_without_its_magnetometer_fails_the_self_test_and_states_why() -> None:
    emulator = Emulator(4)
    bench = Rig(Icm20948(Icm20948Knobs(magnetometer=False)), {0x68: emulator}, lambda *_: None)
    bench.run(0.3)
    found = bench.alone(self_test())
    assert not found.passed
    assert str(found).endswith("magnetometer no answer")


def test_without_the_magnetometer_the_rest_goes_on() -> None:
    emulator = Emulator(0, FAITHFUL)
    bench = Rig(Icm20948(Icm20948Knobs()), {0x68: emulator}, lambda _, now_s: emulator.set_truth(LEVEL, now_s))
    outputs = bench.run(3.0)
    assert len(readings(outputs, Inertial)) > 600
    assert {reason for reason in reasons(outputs) if "magnetometer" in reason}
    assert len(reasons(outputs)) <= 3


LINE = 17


def timed_rig(part: Emulator) -> Rig:
    """The part with its INT1 at a GPIO line; the rate is as different from nominal as a good part's."""
    driver = Icm20948(Icm20948Knobs(data_ready=f"pinctrl-bcm2711:{LINE}"))
    ports: dict[int, RegisterEmulator] = {0x68: part, 0x0C: part.magnetometer, EDGES + LINE: part.data_ready}
    return Rig(driver, ports, lambda _, now_s: part.set_truth(LEVEL, now_s))


def test_with_a_data_ready_line_no_lateness_of_the_host_is_in_the_stamps() -> None:
    part = Emulator(0, SensorErrors(clock_error=0.004, noise=NOISE))
    bench = timed_rig(part)
    found = bench.run(0.3)
    for _ in range(40):  # a host that wakes late, every time
        bench.sleep(0.015)
        found += bench.run(0.02)
    assert not reasons(found)
    period_s, delay_s = 1.004 / 225.0, Icm20948Knobs().filter_delay_s
    newest_s = part.data_ready._newest_s
    for one in readings(found, Inertial)[60:]:
        periods = (newest_s - delay_s - one.stamp / 1e9) / period_s
        assert abs(periods - round(periods)) * period_s < 20e-6


def test_a_line_that_is_cut_is_reported_and_the_samples_go_on_by_the_time_of_the_host() -> None:
    part = Emulator(0, FAITHFUL)
    bench = timed_rig(part)
    whole = bench.run(2.0)
    assert identities(whole)[0].endswith("4 g, timed by line 17 of pinctrl-bcm2711")
    assert not reasons(whole)
    part.data_ready.cut = True
    cut = bench.run(2.0)
    assert set(reasons(cut)) == {SILENT_LINE}
    assert len(reasons(cut)) <= 8
    assert len(readings(cut, Inertial)) == pytest.approx(450, abs=5)
    part.data_ready.cut = False
    bench.run(0.1)
    assert not reasons(bench.run(1.0))


@pytest.mark.parametrize("kind", ["one lost", "one too many"])
def test_an_edge_that_is_lost_or_of_something_else_moves_no_stamp(kind: str) -> None:
    part = Emulator(0, FAITHFUL)
    bench = timed_rig(part)
    found = bench.run(1.0)
    if kind == "one lost":
        part.data_ready._edges -= 1
        part.data_ready._newest_s -= 1 / 225.0
    else:
        part.data_ready.rise(part.data_ready._newest_s + 0.001)
    found += bench.run(1.0)
    assert not reasons(found)
    steps = np.diff([one.stamp / 1e9 for one in readings(found, Inertial)][60:])
    assert steps == pytest.approx(np.full(len(steps), 1 / 225.0), abs=20e-6)
