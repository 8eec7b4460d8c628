"""The PCA9685 driver against the emulator: what is asked for is what a speed controller sees."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.bus_operations import DeviceError, run
from hindrax_core.events import Stamp, after
from hindrax_core.vehicle import Output
from hindrax_drivers.devices.pca9685 import Pca9685
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.emulator import NackError
from hindrax_sim.devices.pca9685 import Pca9685 as Emulator
from hindrax_sim.testing.lock_step import LockStep

CHANNELS = (*range(8), 8, 9)
REST = (1500.0,) * 8 + (1100.0,) * 2


class Bench:
    def __init__(self, clock_error: float = 0.0, known_error: float = 0.0, rate_Hz: float = 200.0) -> None:
        self.chip = Emulator(clock_error=clock_error)
        wires = VirtualI2c()
        wires.attach(0x40, self.chip)
        self.bus = LockStep(wires, Stamp(1_000_000_000))
        self.driver = Pca9685(CHANNELS, REST, Output(rate_Hz=rate_Hz, clock_Hz=25e6 * (1.0 + known_error)))

    def run(self, program: object) -> object:
        return run(program, self.bus.transfer, lambda seconds: self.bus.sleep_until(after(self.bus.now(), seconds)))  # type: ignore[arg-type]

    def seen(self) -> tuple[float | None, ...]:
        return self.chip.pulses_us()[:10]


@settings(max_examples=50)
@given(
    st.lists(st.floats(1100.0, 1900.0), min_size=10, max_size=10),
    st.floats(-0.05, 0.05),
    st.sampled_from([50.0, 100.0, 200.0, 400.0]),
)
def test_the_pulses_seen_are_those_reported_to_be_applied(
    pulses: list[float], clock_error: float, rate_Hz: float
) -> None:
    bench = Bench(clock_error, clock_error, rate_Hz)
    bench.run(bench.driver.configure())
    assert bench.seen() == pytest.approx(bench.driver.applied(REST))
    bench.run(bench.driver.write(pulses))
    assert bench.seen() == pytest.approx(bench.driver.applied(pulses))
    assert bench.seen() == pytest.approx(pulses, abs=bench.driver.step_us / 2 + 1e-6)
    assert bench.chip.rate_Hz <= 400.0
    assert not bench.chip.violations


def test_an_oscillator_that_was_not_measured_moves_neutral_out_of_the_dead_band() -> None:
    bench = Bench(clock_error=0.02)
    bench.run(bench.driver.configure())
    assert abs((bench.seen()[0] or 0.0) - 1500.0) > 25.0


def test_outputs_go_from_nothing_to_neutral_and_never_through_anything_else() -> None:
    bench = Bench()
    bench.run(bench.driver.configure())
    neutral = pytest.approx(bench.driver.applied(REST))
    for change in bench.chip.changes:
        assert change.pulses_us[:10] in ((None,) * 10, neutral)


def test_a_restarted_process_leaves_no_gap_in_the_pulses() -> None:
    bench = Bench()
    bench.run(bench.driver.configure())
    bench.run(bench.driver.write([1900.0] * 10))
    seen = len(bench.chip.changes)
    bench.run(bench.driver.configure())
    later = list(bench.chip.changes)[seen:]
    assert [change.pulses_us[:10] for change in later] == [pytest.approx(bench.driver.applied(REST))]


def test_a_stranger_cannot_write_by_all_call_after_configuration() -> None:
    bench = Bench()
    bench.chip.all_call.write(b"\x00", 1.0)
    bench.run(bench.driver.configure())
    with pytest.raises(NackError):
        bench.chip.all_call.write(b"\x00", 2.0)


def test_a_lost_supply_is_found_out_and_mended() -> None:
    bench = Bench()
    bench.run(bench.driver.configure())
    bench.chip.power_cycle(2.0)
    with pytest.raises(DeviceError, match="its supply was lost"):
        bench.run(bench.driver.check(REST))
    bench.run(bench.driver.configure())
    assert bench.seen() == pytest.approx(bench.driver.applied(REST))


def test_a_bit_that_was_lost_on_the_way_is_found_out() -> None:
    bench = Bench()
    bench.run(bench.driver.configure())
    bench.chip.write(b"\x08\x00", 2.0)
    with pytest.raises(DeviceError, match="channels read back"):
        bench.run(bench.driver.check(REST))


def test_holding_neutral_mends_a_chip_that_lost_its_supply_and_does_not_disturb_one_that_runs() -> None:
    bench = Bench()
    bench.run(bench.driver.hold())
    assert bench.seen() == pytest.approx(bench.driver.applied(REST))
    bench.run(bench.driver.write([1900.0] * 10))
    seen = len(bench.chip.changes)
    bench.run(bench.driver.hold())
    assert len(bench.chip.changes) == seen + 1
    assert bench.seen() == pytest.approx(bench.driver.applied(REST))
    assert not bench.chip.violations


def test_nothing_at_the_address() -> None:
    bus = LockStep(VirtualI2c())
    with pytest.raises(DeviceError, match="no acknowledge"):
        run(Pca9685([0], [1500.0], Output()).configure(), bus.transfer, lambda _seconds: None)


def test_another_device_at_the_address() -> None:
    class Ina219:
        def write(self, data: bytes, now_s: float) -> None:
            pass

        def read(self, count: int, now_s: float) -> bytes:
            del now_s
            return b"\x39\x9f"[:count] + bytes(max(0, count - 2))

    wires = VirtualI2c()
    wires.attach(0x40, Ina219())
    with pytest.raises(DeviceError, match="another device"):
        run(Pca9685([0], [1500.0], Output()).configure(), LockStep(wires).transfer, lambda _seconds: None)
