"""What a vehicle can fly: all that its thrusters serve, and a reason for each motion that they do not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.refusal import require_flyable
from hindrax_control.maneuver.servable import ServableMotions, motions_to_fly, require_servable, servable_motions
from hindrax_core.errors import UsageError
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
    assert str(motions_to_fly(["all"], hindrax)) == "can fly surge, sway, heave, roll, pitch, yaw"


def test_six_thrusters_fly_all_but_pitch_and_say_why(hindrax: Vehicle) -> None:
    found = motions_to_fly(["all"], amidships(hindrax))
    assert found.flown == ("surge", "sway", "heave", "roll", "yaw")
    assert found.left_out == (("pitch", "no thruster serves it"),)
    assert str(found).endswith("; cannot fly pitch: no thruster serves it")


def test_an_axis_that_depends_on_others_names_them(hindrax: Vehicle) -> None:
    ((motion, reason),) = motions_to_fly(["all"], without(hindrax, "T7", "T8")).left_out
    assert motion == "pitch"
    assert reason.startswith("no thruster serves it independently of ")
    assert "heave" in reason


def test_a_named_motion_that_cannot_be_served_is_refused_with_what_could_be_flown(hindrax: Vehicle) -> None:
    six = amidships(hindrax)
    assert motions_to_fly(["yaw", "surge", "yaw"], six).flown == ("yaw", "surge")
    with pytest.raises(UsageError) as refused:
        motions_to_fly(["surge", "pitch"], six)
    assert str(refused.value) == (
        "pitch: no thruster serves it, wanted some of surge, sway, heave, roll, yaw;"
        " correct `thrusters` in the vehicle file, or fly those"
    )


def test_nothing_flies_without_heave(hindrax: Vehicle) -> None:
    flat = without(hindrax, "T5", "T6", "T7", "T8")
    assert servable_motions(AXES, flat).flown == ()
    with pytest.raises(UsageError, match=r"surge: no thruster serves heave, which holds the depth meanwhile.* file$"):
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
        with pytest.raises(UsageError, match=f"found {found}, wanted less than the 62 N that its thrusters give"):
            refuse()
    motions_to_fly(("all",), replace(hindrax, mass_kg=20.0))
