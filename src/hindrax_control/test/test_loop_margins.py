"""Margins of a loop against closed forms, and the fastest law that keeps them over an uncertain vehicle."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_control.hold.loop_margins import Law, LoopDelays, fastest_law, law_of, reference_rate, worst_margins
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.vehicle import Drag

MASS = PriorDynamics(20.0, Drag(60.0, 4.0))
NONE = LoopDelays(0.0, 0.0)


@pytest.mark.parametrize("damping", [0.4, 0.7, 1.0])
def test_phase_margin_of_a_second_order_loop_is_that_of_the_textbook(damping: float) -> None:
    """L = w^2 / (s (s + 2 z w)): margin atan(2 z / sqrt(sqrt(1 + 4 z^4) - 2 z^2)) (Franklin, Powell, eq. 6.32)."""
    drag = 2.0 * damping * 1.5 * 20.0
    law = Law(1.5, damping, 20.0 * 1.5**2, 0.0, 1e9)
    wanted = math.atan(2.0 * damping / math.sqrt(math.sqrt(1.0 + 4.0 * damping**4) - 2.0 * damping**2))
    found = worst_margins(law, [PriorDynamics(20.0, Drag(0.0, drag))], NONE)
    assert found.phase_rad == pytest.approx(wanted, abs=0.02)
    assert found.gain == math.inf
    assert found.stable


def test_the_gain_margin_of_a_delay_is_where_the_phase_has_gone() -> None:
    """Derivative on a mass: L = K_d / (M s) e^(-T s) has its phase at -180 degrees where w = pi / (2 T)."""
    law = Law(1.0, 1.0, 1e-9, 30.0, 1e9)
    delayed = worst_margins(law, [PriorDynamics(20.0, Drag())], LoopDelays(0.0, 0.2))
    assert delayed.gain == pytest.approx(math.pi / 0.4 / (30.0 / 20.0), rel=0.02)


def test_what_cannot_be_stable_is_said_to_be_so() -> None:
    """A bandwidth far beyond the lag of the thrust: the closed loop's own poles lie to the right."""
    law = law_of(MASS, 6.0, 0.2, 1.0)
    closed = np.polyadd(
        np.polymul([0.5, 1.0, 0.0], [20.0, 4.0, 0.0]), [law.derivative, law.proportional, law.proportional / 1.0]
    )
    assert np.max(np.roots(closed).real) > 0.0
    assert not worst_margins(law, [MASS], LoopDelays(0.5, 0.0)).stable


def test_the_fastest_law_keeps_its_margins_and_a_faster_one_does_not() -> None:
    delays = LoopDelays(0.15, 0.05)
    law = fastest_law([MASS], delays, damping=1.0, span_radps=(0.1, 6.0))
    found = worst_margins(law, [MASS], delays)
    assert found.stable
    assert found.sensitivity <= 1.7
    # Bounds of both margins by the sensitivity (Aastroem and Murray, eq. 10.10).
    assert found.gain >= 1.7 / 0.7 - 0.05
    assert found.phase_rad >= 2.0 * math.asin(0.5 / 1.7) - 0.02
    faster = law_of(MASS, 1.15 * law.bandwidth_radps, 1.0, law.integral_s / 1.15)
    assert worst_margins(faster, [MASS], delays).sensitivity > 1.7


def test_what_is_uncertain_is_held_more_slowly_and_the_worst_counts() -> None:
    delays = LoopDelays(0.15, 0.05)
    light = replace(MASS, inertia=12.0)
    sure, unsure = (
        fastest_law(freedoms, delays, damping=1.0, span_radps=(0.1, 6.0)) for freedoms in ([MASS], [MASS, light])
    )
    assert unsure.bandwidth_radps < sure.bandwidth_radps
    apart = [worst_margins(unsure, [one], delays) for one in (MASS, light)]
    both = worst_margins(unsure, [MASS, light], delays)
    assert both.sensitivity == max(one.sensitivity for one in apart)
    assert both.phase_rad == min(one.phase_rad for one in apart)


def test_a_reference_asks_for_no_more_than_its_effort() -> None:
    rate = reference_rate(MASS, 1.0, 15.0)
    assert MASS.drag_force(rate) <= 15.0 + 1e-9
    assert 1.5 * 1.0 * rate * MASS.inertia <= 15.0 + 1e-9
