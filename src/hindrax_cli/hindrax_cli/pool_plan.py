"""`hindrax pool-test --plan`: what to expect of a pool test, from a rehearsal in lock-step."""

import argparse
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from hindrax_analysis.identification.verdict import REJECTED
from hindrax_analysis.next_step import quoted_share
from hindrax_analysis.terminal import print_answer, print_table, print_what_fits, working
from hindrax_bringup.stack import world_of_pool_test
from hindrax_control.maneuver.goal import motions_to_fly
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.model.motion_model import MOTIONS, axis_units
from hindrax_ident.online.aim import Aim, check_experiment
from hindrax_sim.conditions.world_table import sizes_of
from hindrax_sim.flights.rehearsal import Rehearsal, rehearse

OF_THE_STACK = ("fault", "rate", "out", "params", "set")
"""Options of a stack, which a rehearsal does not start: to ignore one would show another plan than is flown."""


def rehearse_and_show(arguments: argparse.Namespace, aim: Aim | None) -> int:
    """Rehearse and print; 1 when a guard ended it. UsageError for options of a stack, which is not started."""
    given = [f"--{name}" for name in OF_THE_STACK if getattr(arguments, name) not in (None, [], "")]
    if given:
        raise UsageError(f"--plan: found {', '.join(given)}, wanted no options of the stack, which it does not start")
    vehicle = load_vehicle(Path(arguments.vehicle))
    world = world_of_pool_test(arguments.world, arguments.simulator)
    sizes_of(world, arguments.seed)
    servable = motions_to_fly(arguments.dof, vehicle)
    print_stderr(f"{vehicle.name} {servable}")
    if aim is not None:
        check_experiment(servable.flown, aim)
    with working("rehearsing in lock-step") as reached:
        found = rehearse(
            servable.flown,
            arguments.seed,
            world,
            vehicle=vehicle,
            excitation=arguments.excitation,
            aim=aim,
            report=reached,
        )
    print_answer(found.document(), lambda: show(found), as_json=arguments.json)
    if found.aborted:
        print_stderr(f"aborted by {found.aborted}")
    return 1 if found.aborted else 0


def predicted_of(arguments: argparse.Namespace, aim: Aim) -> Mapping[str, float]:
    """Tell what to expect of an experiment, in the water in which it is flown; a real vehicle is in a pool.

    Parameters
    ----------
    arguments
        Of `pool-test`.
    aim
        Of the experiment.

    Returns
    -------
    Mapping[str, float]
        Deviation of the drag of each motion, as a share of it [-].
    """
    world = world_of_pool_test(arguments.world, arguments.simulator)
    vehicle = load_vehicle(Path(arguments.vehicle))
    motions = motions_to_fly(arguments.dof, vehicle).flown
    check_experiment(motions, aim)
    print_stderr("rehearsing the flight in lock-step")
    with working("rehearsing") as reached:
        found = rehearse(motions, arguments.seed, world, vehicle=vehicle, aim=aim, report=reached)
    bands = {motion: band.calibrated for motion, band in found.bands.items() if math.isfinite(band.calibrated)}
    each = ", ".join(f"{motion} {quoted_share(share)}" for motion, share in bands.items())
    ended = f"aborted by {found.aborted}" if found.aborted else found.ended
    text = f"predicted: {found.seconds:.0f} s in the water; deviation of the drag at the highest speed: {each}; {ended}"
    print_stderr(text)
    return bands


def show(found: Rehearsal) -> None:
    """Print plan, timetable, intervals and why it ended; on a screen that is too short neither legs nor reasons."""
    rejected = {motion: band.reasons for motion, band in found.bands.items() if band.reasons}

    def way(*, legs: bool, reasons: bool) -> None:
        unsaid = [*(["the legs of each motion"] if found.plans and not legs else [])]
        unsaid += [f"why {REJECTED} (not identifiable)"] if rejected and not reasons else []
        if unsaid:
            print_fitted(f"--json shows: {', '.join(unsaid)}")
        for plan in found.plans if legs else ():
            print_fitted(plan)
        _show_tables(found, dense=not reasons)
        for motion, sentences in rejected.items() if reasons else ():
            print_fitted(f"{REJECTED} {motion}: {'; '.join(sentences)}")
        if found.ended:
            print_fitted(f"ended: {found.ended}")

    print_what_fits(
        partial(way, legs=True, reasons=True),
        partial(way, legs=False, reasons=True),
        partial(way, legs=False, reasons=False),
    )


def _show_tables(found: Rehearsal, *, dense: bool) -> None:
    numbers = ("from [s]", "to [s]", "wall [m]", "floor [m]", "charge [Ah]")
    rows = []
    for one in found.flown:
        cells = (one.wall_m, one.floor_m, one.charge_Ah)
        rows.append((one.motion, f"{one.begin_s:.0f}", f"{one.end_s:.0f}", *(f"{cell:.2f}" for cell in cells)))
    drawn = f"{found.seconds:.0f} s in the water, {found.charge_Ah:.2f} Ah by momentum theory"
    print_table(f"{found.vehicle} in the world {found.world}: {drawn}", ("motion",), numbers, rows, dense=dense)
    rows = []
    for motion, band in found.bands.items():
        shares = (band.noise, band.calibrated, band.added_mass)
        percents = ("" if math.isnan(share) else quoted_share(share).rstrip("%") for share in shares)
        unit, _ = axis_units(MOTIONS[motion].axis)
        rows.append((f"{motion}{REJECTED if band.reasons else ''}", f"{band.speed:.2f} {unit}", *percents))
    title = "Standard deviations to be expected: of the drag, by noise and in all; of added mass"
    names = ("highest speed", "noise [%]", "calibrated [%]", "added mass [%]")
    print_table(title, ("motion",), names, rows, dense=dense)
