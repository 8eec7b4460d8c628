"""What a vehicle can fly: all that its thrusters serve, and a reason for each motion that they do not."""

from dataclasses import replace

import pytest

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.maneuver.goal import (
    UNMEASURED,
    Goal,
    ServableMotions,
    largest_wrench,
    motions_to_fly,
    require_flyable,
    require_servable,
    servable_motions,
)
from hindrax_core.errors import UsageError
from hindrax_core.text.refusals import Reason, refusal_of
from hindrax_core.thrust.curves import Branch, Curve
from hindrax_core.vehicle import AXES, Vehicle


def without(vehicle: Vehicle, *names: str) -> Vehicle:
    return replace(vehicle, thrusters=tuple(one for one in vehicle.thrusters if one.name not in names))


def amidships(vehicle: Vehicle) -> Vehicle:
    """Six thrusters: four level ones in the plane of the center of mass, two vertical ones amidships."""
    x_m, _, z_m = vehicle.center_of_mass_m
    six = without(vehicle, "T7", "T8").thrusters
    moved = tuple(
        replace(
            one, position_m=(x_m, one.position_m[1], z_m) if one.name in ("T5", "T6") else (*one.position_m[:2], z_m)
        )
        for one in six
    )
    return replace(vehicle, thrusters=moved)


def test_the_hindrax_flies_everything(hindrax: Vehicle) -> None:
    assert servable_motions(AXES, hindrax) == ServableMotions(AXES, ())
    assert str(motions_to_fly(["all"], hindrax)) == "flies surge, sway, heave, roll, pitch, yaw"


def test_six_thrusters_fly_all_but_pitch_and_say_why(hindrax: Vehicle) -> None:
    found = motions_to_fly(["all"], amidships(hindrax))
    assert found.flown == ("surge", "sway", "heave", "roll", "yaw")
    assert found.left_out == (("pitch", "no thruster serves it"),)
    assert str(found).endswith("; does not fly pitch: no thruster serves it")


def test_an_axis_that_depends_on_others_names_them(hindrax: Vehicle) -> None:
    ((motion, reason),) = motions_to_fly(["all"], without(hindrax, "T7", "T8")).left_out
    assert motion == "pitch"
    assert reason.startswith("no thruster serves it independently of ")
    assert "heave" in reason


@pytest.mark.parametrize(("apart_m", "bound"), [(0.0, "heave"), (0.004, "heave"), (0.04, "heave and roll")])
def test_an_axis_is_bound_to_those_that_make_a_twentieth_of_it(hindrax: Vehicle, apart_m: float, bound: str) -> None:
    """Two vertical thrusters ahead of the center of mass, at x = a and a + d, y = b and -b: Z (1, 1), K (b, -b).

    Pitch is -(a, a + d) = -(a + d/2) (1, 1) + d/2 (1, -1), so K has d / (2 a) of it.
    """
    x_m, y_m, z_m = hindrax.center_of_mass_m
    places = {"T5": (x_m + 0.1, y_m + 0.1, z_m), "T6": (x_m + 0.1 + apart_m, y_m - 0.1, z_m)}
    six = amidships(hindrax)
    moved = tuple(replace(one, position_m=places.get(one.name, one.position_m)) for one in six.thrusters)
    found = servable_motions(AXES, replace(six, thrusters=moved))
    assert found.left_out == (("pitch", f"no thruster serves it independently of {bound}"),)


def test_the_largest_wrench_is_that_of_the_weaker_way_and_none_where_nothing_serves(hindrax: Vehicle) -> None:
    low_N, high_N = thrust_curves(hindrax)[0].range_N
    weakest_N = min(-low_N, high_N)
    assert largest_wrench(hindrax)["heave"] == pytest.approx(4.0 * weakest_N)
    six = largest_wrench(amidships(hindrax))
    assert six["heave"] == pytest.approx(2.0 * weakest_N)
    assert six["pitch"] == 0.0
    assert largest_wrench(without(hindrax, "T5", "T6", "T7", "T8")) == dict.fromkeys(AXES, 0.0)
    assert largest_wrench(replace(hindrax, thrusters=())) == dict.fromkeys(AXES, 0.0)


def test_a_named_motion_that_cannot_be_served_is_refused_with_what_could_be_flown(hindrax: Vehicle) -> None:
    six = amidships(hindrax)
    assert motions_to_fly(["yaw", "surge", "yaw"], six).flown == ("yaw", "surge")
    with pytest.raises(UsageError) as refused:
        motions_to_fly(["surge", "pitch"], six)
    assert str(refused.value) == (
        "pitch: no thruster serves it, wanted some of surge, sway, heave, roll, yaw;"
        " correct `thrusters` in the vehicle file, or fly those"
    )


NO_HEAVE = "no thruster serves heave, which holds the depth meanwhile"


def test_nothing_flies_without_heave(hindrax: Vehicle) -> None:
    flat = without(hindrax, "T5", "T6", "T7", "T8")
    assert servable_motions(AXES, flat).flown == ()
    with pytest.raises(
        UsageError, match=f"surge: {NO_HEAVE}, wanted thrusters that do; correct `thrusters` in .* file$"
    ):
        motions_to_fly(["all"], flat)


@pytest.mark.parametrize("disabled", [(), ("T3", "T4"), ("T5",), ("T7", "T8"), ("T5", "T8")])
def test_it_agrees_with_the_allocator(hindrax: Vehicle, disabled: tuple[str, ...]) -> None:
    out = frozenset(disabled)
    lost = Allocator(hindrax).lost_axes(out)
    found = servable_motions(AXES, hindrax, out)
    assert tuple(motion for motion, _ in found.left_out) == lost
    for motion in lost:
        with pytest.raises(
            UsageError, match=rf"{motion}: without {', '.join(disabled)} .*`\./hindrax thruster enable`"
        ):
            require_servable((motion,), hindrax, out)


@pytest.mark.parametrize(("mass_kg", "found"), [(25.0, "95 N of net weight"), (5.0, "101 N of net buoyancy")])
def test_what_its_thrusters_cannot_hold_at_a_depth_is_refused(hindrax: Vehicle, mass_kg: float, found: str) -> None:
    heavy = replace(hindrax, mass_kg=mass_kg)
    for refuse in (lambda: motions_to_fly(("all",), heavy), lambda: require_flyable(Goal(("surge",)), heavy)):
        with pytest.raises(UsageError, match=f"found {found}, wanted less than the 62 N that its thrusters") as why:
            refuse()
        assert refusal_of(why.value).reason is Reason.LIFT
    motions_to_fly(("all",), replace(hindrax, mass_kg=20.0))


def test_a_small_vehicle_must_be_trimmed_as_well(hindrax: Vehicle) -> None:
    # 0.16 N: force = -0.15 N + 1e-4 N/us * pulse, from 1100 us on, four times
    weak = {name: Curve(Branch((-0.15, 1e-4, 0.0, 0.0), 1100.0, 1475.0)) for name in hindrax.curves}
    floating_kg = hindrax.volume_m3 * hindrax.water.density_kgpm3
    for off_kg, pull in ((-0.07, "net buoyancy"), (0.07, "net weight")):
        with pytest.raises(UsageError, match=f"found 1 N of {pull}, wanted less than the 0 N"):
            motions_to_fly(("all",), replace(hindrax, curves=weak, mass_kg=floating_kg + off_kg))
    motions_to_fly(("all",), replace(hindrax, curves=weak, mass_kg=floating_kg + 0.01))


def test_a_goal_of_a_motion_that_is_not_served_is_refused(hindrax: Vehicle) -> None:
    with pytest.raises(UsageError, match="pitch: no thruster serves it, wanted some of"):
        require_flyable(Goal(("surge", "pitch")), amidships(hindrax))
    with pytest.raises(UsageError, match="sway: without T3, T4"):
        require_flyable(Goal(("sway",)), hindrax, frozenset(("T3", "T4")))


def test_a_goal_that_no_vehicle_can_fly_is_refused_for_what_is_wrong_with_it(hindrax: Vehicle) -> None:
    with pytest.raises(UsageError, match="goal: ending 'sink' unknown"):
        require_flyable(Goal(("surge",), on_cancel="sink"), hindrax)


def test_without_a_dvl_surge_and_sway_are_left_out_before_anything_starts(hindrax: Vehicle) -> None:
    blind = replace(hindrax, sensors={name: hindrax.sensors[name] for name in hindrax.measuring("rates")})
    found = motions_to_fly(("all",), blind)
    assert found.flown == ("heave", "roll", "pitch", "yaw")
    assert found.left_out == (("surge", UNMEASURED), ("sway", UNMEASURED))
    wanted = (
        "sway: nothing measures its velocity, wanted a DVL, or a sonar that looks aside; .* heave, roll, pitch, yaw. "
        "An odometry of yours .* poses alone do not, .* `./hindrax identify BAG --odometry TOPIC`"
    )
    with pytest.raises(UsageError, match=wanted):
        motions_to_fly(("yaw", "sway"), blind)
    # A file without sensors flies by somebody else's odometry.
    assert motions_to_fly(("all",), replace(hindrax, sensors={})).flown == AXES
    require_flyable(Goal(("surge",)), blind)  # the pilot looks at the state of the moment
