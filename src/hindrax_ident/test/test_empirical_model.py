"""Laws that any estimate from dimensions must keep. Eidsvik 2015."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.errors import HindraxError
from hindrax_ident.model.empirical_model import AREAS_ASSUMED, Dimensions, empirical

HINDRAX = Dimensions(0.59, 0.47, 0.40, 15.22, buoyancy_arm_m=0.03)
POWERS_ADDED_MASS = (3, 3, 3, 5, 5, 5)
POWERS_QUADRATIC = (2, 2, 2, 5, 5, 5)


@given(st.floats(0.2, 5.0), st.floats(900.0, 1100.0))
def test_a_scaled_vehicle_keeps_its_coefficients(scale: float, density: float) -> None:
    small = empirical(HINDRAX)
    large = empirical(Dimensions(0.59 * scale, 0.47 * scale, 0.40 * scale, 15.22, density_kgpm3=density))
    ratio = density / 1000.0
    for axis in range(6):
        assert large.added_mass[axis] == pytest.approx(
            small.added_mass[axis] * ratio * scale ** POWERS_ADDED_MASS[axis]
        )
        assert large.quadratic_drag[axis] == pytest.approx(
            small.quadratic_drag[axis] * ratio * scale ** POWERS_QUADRATIC[axis]
        )


def test_inertia_of_the_hindrax_as_a_prism() -> None:
    assert empirical(HINDRAX).inertia_kgm2 == pytest.approx((0.4831, 0.6445, 0.7217), abs=5e-4)


def test_linear_drag_of_roll_follows_its_damping_ratio() -> None:
    model = empirical(HINDRAX)
    stiffness = 15.22 * 9.80665 * 0.03
    assert model.restoring_Nm == pytest.approx(stiffness)
    inertia = model.inertia_kgm2[0] + model.added_mass[3]
    assert model.linear_drag[3] == pytest.approx(2.0 * 0.025 * (stiffness * inertia) ** 0.5)
    assert model.linear_drag[0] == pytest.approx(0.16 * model.quadratic_drag[0])


def test_what_was_assumed_is_reported() -> None:
    assert AREAS_ASSUMED in empirical(HINDRAX).notes
    assert empirical(Dimensions(0.59, 0.47, 0.40, 15.22, 0.1, 0.15, 0.2)).notes == ()
    assert any("taken as 6, the end of its table" in note for note in empirical(Dimensions(3.0, 0.3, 0.3, 50.0)).notes)


@pytest.mark.parametrize(
    ("field", "value"), [("front_m2", 0.5), ("top_m2", 0.0), ("length_m", -1.0), ("mass_kg", float("nan"))]
)
def test_impossible_dimensions_are_refused_by_name(field: str, value: float) -> None:
    given_values: dict[str, Any] = {"length_m": 0.59, "width_m": 0.47, "height_m": 0.40, "mass_kg": 15.22, field: value}
    with pytest.raises(HindraxError, match=field):
        Dimensions(**given_values)
