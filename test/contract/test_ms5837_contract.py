"""The MS5837 driver against the emulator: truth in, the same truth out."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from register_rig import START, Rig, identities, readings, reasons

from hindrax_core.bus_operations import Write
from hindrax_core.events import seconds_between
from hindrax_core.readings import Pressure
from hindrax_drivers.devices.ms5837 import OSRS, Ms5837, Ms5837Knobs
from hindrax_sim.devices.ms5837 import PROM_30BA, NOISE_Pa
from hindrax_sim.devices.ms5837 import Ms5837 as Emulator

STEPS_Pa = {"30BA": 10.0, "02BA": 1.0}


def water(pressure_Pa: float = 101_325.0, temperature_C: float = 20.0) -> Pressure:
    return Pressure(pressure_Pa, temperature_C)


def rig(truth: Pressure, model: str = "30BA", noise: float = 0.02, knobs: Ms5837Knobs | None = None) -> Rig:
    emulator = Emulator(model, noise=noise)  # type: ignore[arg-type]
    emulator.set_truth(truth, 0.0)
    return Rig(Ms5837(knobs or Ms5837Knobs()), {0x76: emulator}, lambda *_: None)


@settings(max_examples=60, deadline=None)
@given(st.floats(20_000.0, 3.0e6), st.floats(-39.0, 84.0))
def test_the_30ba_gives_the_truth_within_a_step(pressure_Pa: float, temperature_C: float) -> None:
    check(water(pressure_Pa, temperature_C), "30BA")


@settings(max_examples=60, deadline=None)
@given(st.floats(20_000.0, 200_000.0), st.floats(-39.0, 84.0))
def test_the_02ba_gives_the_truth_within_a_step(pressure_Pa: float, temperature_C: float) -> None:
    check(water(pressure_Pa, temperature_C), "02BA")


def check(truth: Pressure, model: str) -> None:
    outputs = rig(truth, model).run(0.2)
    found = readings(outputs, Pressure)
    assert len(found) >= 5
    assert not reasons(outputs)
    for one in found:
        # One step of the datasheet's integers, and what a hundredth of a degree is worth at this pressure.
        tolerance_Pa = STEPS_Pa[model] + 4 * 0.02 * NOISE_Pa[model][4] + 2e-5 * truth.pressure_Pa
        assert one.reading.pressure_Pa == pytest.approx(truth.pressure_Pa, abs=tolerance_Pa)
        # Two integers are rounded down and subtracted, a step either way, and a count of D2 is worth a third of one.
        assert one.reading.temperature_C == pytest.approx(truth.temperature_C, abs=0.0135)


def test_fifty_pressures_a_second_at_oversampling_4096() -> None:
    outputs = readings(rig(water(), noise=1.0).run(5.0), Pressure)
    assert len(outputs) == pytest.approx(250, abs=26)  # every tenth turn also converts the temperature: 20.4 ms
    gaps = np.diff([seconds_between(START, one.stamp) for one in outputs])
    assert gaps.max() < 0.032


@pytest.mark.parametrize("osr", OSRS)
def test_every_oversampling_is_waited_for(osr: str) -> None:
    knobs = Ms5837Knobs(oversampling=osr, period_s=0.05)
    outputs = rig(water(150_000.0, 12.0), knobs=knobs, noise=1.0).run(2.0)
    values = np.array([one.reading.pressure_Pa for one in readings(outputs, Pressure)])
    assert not reasons(outputs)
    sigma = NOISE_Pa["30BA"][OSRS.index(osr)]
    assert values.mean() == pytest.approx(150_000.0, abs=sigma)
    assert values.std() == pytest.approx(np.hypot(sigma, 10.0 / np.sqrt(12.0)), rel=0.5)


@pytest.mark.parametrize(("model", "c1"), [("30BA", 34982), ("02BA", 46372)])
def test_the_model_is_found_and_given(model: str, c1: int) -> None:
    assert identities(rig(water(), model).run(0.1)) == [f"MS5837-{model} at 0x76, C1 {c1}"]


def test_a_30ba_without_product_number_is_not_taken_for_an_02ba() -> None:
    emulator = Emulator("30BA")
    emulator.prom = (0x2000, *PROM_30BA[1:])  # product number zero, as many in the field have it
    outputs = Rig(Ms5837(), {0x76: emulator}, lambda *_: None).run(0.2)
    assert identities(outputs) == ["MS5837-30BA at 0x76, C1 34982"]


def test_the_bus_is_free_for_others_while_it_converts() -> None:
    bench = rig(water())
    bench.run(1.0)
    waits = [
        read - ordered
        for (ordered, command, _), (read, _, _) in pairwise(bench.wires.log)
        if command in (Write(0x76, b"\x48"), Write(0x76, b"\x58"))
    ]
    assert len(waits) > 45
    assert min(waits) >= 9_020_000


def test_the_pressure_of_a_depth_is_right_to_three_millimeters() -> None:
    deep_Pa = 101_325.0 + 0.9 * 997.0 * 9.80665
    outputs = readings(rig(water(deep_Pa)).run(0.3), Pressure)
    assert outputs[-1].reading.pressure_Pa == pytest.approx(deep_Pa, abs=0.003 * 997.0 * 9.80665)


def refusals(before: Pressure, then: Pressure, knobs: Ms5837Knobs) -> list[str]:
    """Reasons of refusal when the water changes at once after 3.1 s; in the end the new water is read."""
    emulator = Emulator("30BA", noise=0.02)
    bench = Rig(
        Ms5837(knobs),
        {0x76: emulator},
        lambda elapsed_s, now_s: emulator.set_truth(before if elapsed_s < 3.1 else then, now_s),
    )
    outputs = bench.run(8.1)
    assert readings(outputs, Pressure)[-1].reading.pressure_Pa == pytest.approx(then.pressure_Pa, abs=50.0)
    return reasons(outputs)


@pytest.mark.parametrize(("period_s", "refused"), [(0.02, 3), (1.0, 0)])
def test_what_a_step_may_be_follows_the_period(period_s: float, refused: int) -> None:
    """Half a metre of water in a second is a dive, in a fiftieth of one it is damage, until it stays."""
    found = refusals(water(150_000.0), water(155_000.0), Ms5837Knobs(period_s=period_s))
    assert len([reason for reason in found if reason.startswith("leap of +")]) == len(found) == refused


@pytest.mark.parametrize(
    ("period_s", "every", "to_C", "refused"),
    [(0.02, 1, 20.0, 3), (0.02, 50, 20.0, 0), (1.0, 1, 15.2, 0), (1.0, 1, 14.8, 1)],
)
def test_a_slow_temperature_may_change_with_its_own_period(
    period_s: float, every: int, to_C: float, refused: int
) -> None:
    """By 10 K in a second since the last reading that was believed."""
    knobs = Ms5837Knobs(period_s=period_s, temperature_every=every)
    assert len(refusals(water(temperature_C=25.0), water(temperature_C=to_C), knobs)) == refused
