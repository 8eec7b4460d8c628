"""The analysis as a library: what a notebook gets from a bag, and laws that its predictions keep."""

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from hindrax_analysis import api
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.results import DragBand, MotionResult, Number, Results
from hindrax_ident.model.motion_model import MOTIONS, coefficient_units

ROOT = Path(__file__).parents[2]
BAG = ROOT / "test/replay/bags/pitch_reset"
VEHICLE = load_vehicle(ROOT / "src/hindrax_bringup/vehicles/hindrax.yaml")


def results(**motions: dict[str, float]) -> Results:
    """Results with these values, as if identified; nothing else of them is known."""
    speeds = array(np.linspace(0.1, 0.4, 4))
    made = {
        motion: MotionResult(
            motion=motion,
            method="given",
            coefficients={
                name: Number(value, 0.1, unit=coefficient_units(MOTIONS[motion].axis)[name])
                for name, value in values.items()
            },
            names=tuple(values),
            covariance=array(0.01 * np.eye(len(values))),
            samples=100,
            effective_samples=100.0,
            identifiable=True,
            reasons=(),
            speeds=(0.1, 0.4),
            drag=DragBand(speeds, speeds**2, 0.1 * speeds, array(np.full(4, math.nan))),
        )
        for motion, values in motions.items()
    }
    return Results(made, VEHICLE)


SURGE = {"k_q": 66.5, "k_l": 1.3, "b": 0.4, "added_mass": 12.0}


def test_an_unknown_motion_is_named_with_those_that_there_are() -> None:
    wanted = "found 'surgee', wanted some of surge, sway, heave, roll, pitch, yaw, heave_down, heave_up"
    with pytest.raises(UsageError, match=wanted):
        api.predict(results(surge=SURGE), "surgee", [0.0, 1.0], [1.0, 1.0])
    with pytest.raises(UsageError, match=wanted):
        api.identify(BAG, motions=["surge", "surgee"])


def test_a_table_without_coefficients_has_its_columns() -> None:
    """Of a record that shows nothing: who filters by motion finds no row."""
    columns = {name: len(column) for name, column in api.coefficients(results(surge={})).items()}
    assert columns == dict.fromkeys(api.coefficients(results(surge=SURGE)), 0)


@pytest.mark.parametrize("force", [14.0, 3.0, -14.0])
def test_a_constant_force_ends_in_the_balance_of_the_model(force: float) -> None:
    t = np.linspace(0.0, 120.0, 1201)
    v = api.predict(results(surge=SURGE), "surge", t, np.full(len(t), force))
    assert abs(v[0]) < 1e-9
    # Newton at the start, and the balance of forces at the end.
    assert v[1] == pytest.approx((force - 0.4) / (VEHICLE.mass_kg + 12.0) * t[1], rel=0.02)
    assert 66.5 * abs(v[-1]) * v[-1] + 1.3 * v[-1] + 0.4 == pytest.approx(force, rel=1e-6)


def test_each_direction_of_heave_has_its_own_drag() -> None:
    down, up = {**SURGE, "b": 0.0}, {**SURGE, "b": 0.0, "k_q": 20.0}
    t = np.linspace(0.0, 120.0, 1201)
    of = results(heave_down=down, heave_up=up)
    ends = [api.predict(of, "heave", t, np.full(len(t), force))[-1] for force in (10.0, -10.0)]
    assert 66.5 * ends[0] ** 2 + 1.3 * ends[0] == pytest.approx(10.0, rel=1e-6)
    assert 20.0 * ends[1] ** 2 - 1.3 * ends[1] == pytest.approx(10.0, rel=1e-6)


def test_what_was_not_identified_is_not_predicted() -> None:
    with pytest.raises(UsageError, match="surge: found no mass"):
        api.predict(results(surge={"k_q": 1.0, "k_l": 1.0, "b": 0.0}), "surge", (0.0, 1.0), (1.0, 1.0))
    with pytest.raises(UsageError, match="sway: found no k_q"):
        api.predict(results(surge=SURGE), "sway", (0.0, 1.0), (1.0, 1.0))
    with pytest.raises(UsageError, match="rising times"):
        api.predict(results(surge=SURGE), "surge", (0.0, 0.0), (1.0, 1.0))


def test_a_bag_is_read_as_columns_and_identified() -> None:
    table = api.read(BAG, "/hindrax/dvl75/velocity")
    assert api.topics(BAG)["/hindrax/dvl75/velocity"] == "geometry_msgs/msg/TwistWithCovarianceStamped"
    assert {len(column) for column in table.values()} == {len(table["time_s"])}
    assert np.all(np.diff(table["time_s"]) >= 0.0)
    assert table["twist.twist.linear.x"].dtype == float
    with pytest.raises(UsageError, match="no message on /strange; there are /hindrax"):
        api.read(BAG, "/strange")
    found = api.coefficients(api.identify(BAG, motions=["pitch"]))
    assert {len(column) for column in found.values()} == {5}
    # The mock flew this bag: what it was given lies within four deviations.
    assert np.all(np.abs(found["value"] - found["truth"]) < 4.0 * found["std"])
    assert found["unit"][list(found["coefficient"]).index("k_r")] == "N m"


def test_a_drag_curve_is_drawn_with_its_band_and_units() -> None:
    of = results(surge=SURGE)
    axes = api.plot(of, "surge", Figure().subplots())
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed [m/s]", "drag [N]")
    band = np.asarray(axes.collections[0].get_paths()[0].vertices)
    assert np.max(band[:, 1]) == pytest.approx(0.4**2 + 1.96 * 0.1 * 0.4)
    with pytest.raises(UsageError, match="yaw: has no drag curve; there is one of surge"):
        api.plot(of, "yaw")


def test_a_wrench_is_allocated() -> None:
    wanted = (14.0, 0.0, 2.0, 0.0, 0.0, 0.5)
    assert api.allocate(VEHICLE, wanted).achieved == pytest.approx(wanted, abs=0.05)
    without = api.allocate(VEHICLE, wanted, {"T3"})
    assert without.forces_N[2] == 0.0
    assert np.add(without.achieved, without.shortfall) == pytest.approx(wanted)
    with pytest.raises(UsageError, match="found 'T9', wanted some of T1"):
        api.allocate(VEHICLE, (0.0,) * 6, {"T9"})


def test_nothing_to_identify_is_named() -> None:
    with pytest.raises(UsageError, match="found no record"):
        api.identify()
