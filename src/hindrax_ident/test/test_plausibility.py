"""What nobody measured does not count as a fact."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.signals import NAN, IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import Code, Objection
from hindrax_ident.assess.plausibility import (
    INERTIA_SHARE,
    Planar,
    planar,
    turned_by,
    with_mass_checks,
    with_plausibility_check,
)
from hindrax_ident.assess.results import Contribution, DragBand, MotionResult, Number
from hindrax_ident.online.record_session import RecordSession

BOX = Vehicle("box", mass_kg=20.0, volume_m3=0.0203, envelope_m=(0.6, 0.5, 0.4))
FOUND = Number(0.8, 0.01, 0.02, unit="kg m^2")


def turned(motion: str) -> MotionResult:
    return MotionResult(
        motion, "output-error", {"added_mass": FOUND}, identifiable=True, speeds=(0.1, 1.0), names=("added_mass",),
        covariance=np.eye(1), samples=100, effective_samples=90.0,
        budget={"added_mass": [Contribution("noise", 0.01, "")]},
    )  # fmt: skip


def test_the_added_mass_of_a_turn_is_no_better_than_an_inertia_that_nobody_named() -> None:
    found = with_mass_checks(turned("yaw"), BOX)
    doubt = INERTIA_SHARE * 20.0 * (0.6**2 + 0.5**2) / 12.0
    assert found.coefficients["added_mass"].std_calibrated == pytest.approx(np.hypot(0.02, doubt))
    assert found.coefficients["added_mass"].std == FOUND.std
    assert [row.influence for row in found.budget["added_mass"]] == ["inertia of the body", "noise"]


def test_an_inertia_that_was_named_is_accepted_and_a_mass_always() -> None:
    assert with_mass_checks(turned("yaw"), replace(BOX, inertia_kgm2=(0.5, 0.6, 0.7))) == turned("yaw")
    assert with_mass_checks(turned("surge"), BOX) == turned("surge")


@pytest.mark.parametrize(("share", "axes", "warned"), [(1.0, False, False), (-1.0, True, True), (-3.0, False, True)])
def test_a_net_buoyancy_of_the_other_sign_tells_of_axes_that_point_up(share: float, axes: bool, warned: bool) -> None:
    found = Number(share * BOX.net_buoyancy_N, 0.1, 0.2, unit="N")
    told = with_mass_checks(replace(turned("heave_down"), coefficients={"b": found}), BOX).warnings
    assert [one.code for one in told] == [Code.OTHER_WEIGHT] * warned
    assert ("--frame flu" in " ".join(map(str, told))) == axes


@pytest.mark.parametrize(("share", "implausible"), [(0.2, True), (0.4, True), (0.8, False), (30.0, False)])
def test_a_drag_that_may_be_anything_is_no_wrong_unit(share: float, implausible: bool) -> None:
    """A drag coefficient of 1000; a unit that is off shows in numbers that are known."""
    force = 1000.0 * 0.5 * 1000.0 * 0.3**2 * BOX.characteristic_length_m**2
    speed, size, noise, wide = (array([one, one]) for one in (0.3, force, 0.1 * share * force, share * force))
    drag = DragBand(speed, size, noise, wide)
    surge = replace(turned("surge"), coefficients={"k_q": Number(60.0, 1.0)}, drag=drag)
    codes = [one.code for one in with_plausibility_check(surge, BOX).reasons]
    assert codes == ([Code.IMPLAUSIBLE_DRAG] if implausible else [])


@pytest.mark.parametrize(("sigma_kg", "implausible"), [(5.0, True), (90.0, False)])
def test_a_mass_that_may_be_anything_is_no_wrong_unit(sigma_kg: float, implausible: bool) -> None:
    """240 kg of 20 kg, where a flat plate has 160."""
    surge = replace(turned("surge"), coefficients={"added_mass": Number(240.0, 1.0, sigma_kg)})
    codes = [one.code for one in with_plausibility_check(surge, BOX).reasons]
    assert codes == ([Code.IMPLAUSIBLE_MASS] if implausible else [])


class Steered(NamedTuple):
    """Times (n,), velocities and thrusts (n, 6)."""

    t: Array
    velocity: Array
    wrench: Array

    @property
    def plane(self) -> Planar:
        turns = array(self.velocity[:, 5])
        rates = (self.t, turns) if np.isfinite(turns).all() else (array(np.zeros(0)), array(np.zeros(0)))
        return planar((self.t, array(self.wrench[:, :2])), (self.t, array(self.velocity[:, :2])), rates)


def steered(turn: complex = 1.0, *, mirrored: bool = False, sway_N: float = 12.0, current_mps: float = 0.0) -> Steered:
    """Sticks of surge and sway; the velocity is turned, or both axes change places."""
    rng, v, speeds, forces = np.random.default_rng(7), 0.0j, [], []
    pushes = np.repeat(rng.uniform(-1.0, 1.0, (60, 2)) * (20.0, sway_N), 40, axis=0)
    for X, Y in pushes.tolist():
        speeds.append(v)
        forces.append((X, Y))
        v += 0.05 * (X + 1j * Y - 60.0 * abs(v) * v.real - 90.0j * abs(v) * v.imag) / 30.0
    seen = np.array(speeds) * turn
    t = array(0.05 * np.arange(len(seen)))
    velocity, wrench = np.full((len(t), 6), np.nan), np.zeros((len(t), 6))
    columns = [seen.imag, seen.real] if mirrored else [seen.real, seen.imag]
    velocity[:, :2] = np.column_stack(columns) + rng.normal(0.0, 0.02, (len(t), 2)) + (0.0, current_mps)
    wrench[:, :2] = forces
    return Steered(t, array(velocity), array(wrench))


def is_refused_for(found: Objection) -> bool:
    return not with_plausibility_check(turned("surge"), BOX, found).identifiable


@pytest.mark.parametrize("angle_deg", [-135.0, -45.0, -12.0, 12.0, 25.0, 90.0])
def test_a_sensor_that_is_turned_in_the_hull_is_named(angle_deg: float) -> None:
    """45 deg made "most by stamps of the record: record thrust and velocity with stamps of one clock"."""
    found = turned_by([steered(np.exp(1j * np.radians(angle_deg))).plane])
    assert found.code is Code.TURNED_VELOCITY
    assert found.numbers["angle_deg"] == pytest.approx(abs(angle_deg), abs=3.0)
    assert found.numbers["side"] == ("starboard" if angle_deg > 0.0 else "port")
    assert is_refused_for(found) is (abs(angle_deg) > 20.0)
    assert found in (with_plausibility_check(turned("surge"), BOX, found).warnings) or is_refused_for(found)
    assert with_plausibility_check(turned("yaw"), BOX, found) == turned("yaw")


def test_axes_that_change_places_are_named() -> None:
    found = turned_by([steered(mirrored=True).plane])
    assert found.code is Code.SWAPPED_VELOCITIES
    assert is_refused_for(found)


@pytest.mark.parametrize(
    "record",
    [steered(), steered(current_mps=0.3), steered(np.exp(0.1j)), steered(-1.0), steered(np.exp(1.0j), sway_N=1.0)],
    ids=["true", "a current", "5 deg", "a wrong sign", "surge alone"],
)
def test_what_is_not_turned_or_cannot_be_told_is_no_objection(record: Steered) -> None:
    assert not turned_by([record.plane])
    assert not turned_by([])


def test_a_vehicle_that_circles_is_not_turned() -> None:
    """All the time to starboard, its velocity drags behind the bow."""
    dragged = steered(complex(np.exp(-0.5j)))
    velocity = dragged.velocity.copy()
    velocity[:, 5] = 0.6
    assert turned_by([dragged.plane])
    assert not turned_by([dragged._replace(velocity=array(velocity)).plane])


def flown(record: Steered) -> Iterator[Stamped[IdentEvent]]:
    for t_s, nu, wrench in zip(record.t.tolist(), record.velocity.tolist(), record.wrench.tolist(), strict=True):
        yield Stamped(after(Stamp(1), t_s), Thrust(tuple(wrench)))
        yield Stamped(after(Stamp(1), t_s), Velocity(tuple(nu), "odometry"))


@pytest.mark.parametrize(
    ("record", "code"),
    [
        (steered(complex(np.exp(1j * np.radians(35.0)))), Code.TURNED_VELOCITY),
        (steered(100.0), Code.IMPLAUSIBLE_SPEED),
    ],
    ids=["a sensor turned by 35 deg", "velocities in cm/s"],
)
def test_the_verdict_while_flying_asks_what_that_of_a_log_asks(record: Steered, code: Code) -> None:
    """It asked none of these: the node of a foreign stack said *identified*."""
    session = RecordSession(BOX)
    for _ in session.step(*flown(record)):
        pass
    surge = session.finalize()["surge"]
    assert not surge.identifiable
    assert code in [reason.code for reason in surge.reasons]


def test_a_sway_that_nobody_measures_is_no_turn() -> None:
    record = steered(sway_N=12.0)
    velocity = record.velocity.copy()
    velocity[:, 1] = NAN
    session = RecordSession(BOX)
    for _ in session.step(*flown(record._replace(velocity=array(velocity)))):
        pass
    assert Code.TURNED_VELOCITY not in [one.code for one in session.finalize()["surge"].reasons]
