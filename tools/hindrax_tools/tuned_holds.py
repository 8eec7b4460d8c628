"""Holds with the gains of `hindrax tune` against those as shipped, in pools that nobody has seen.

    python -m hindrax_tools.tuned_holds --worlds 10 --seed 1

In each world a pool test is flown in lock-step and identified; gains are made of what was identified, as `tune` makes
them; then the vehicle as it really is in that world flies each step twice, with these gains and with the shipped ones.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_analysis.coefficients_file import SavedCoefficients, conditions_of
from hindrax_analysis.gains.hold_gains import hold_gains
from hindrax_analysis.terminal import print_table
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions.world_table import POOL
from hindrax_sim.flights.pool_flight import fly
from hindrax_sim.flights.step_flight import STEPS, SetpointStep, StepOutcome, step_flight
from hindrax_tools.commissioning_draws import vehicle_of

MOTIONS = ("surge", "sway", "heave", "yaw")
"""Roll and pitch keep the gains of the vehicle file, as after the usual pool test."""


@dataclass(frozen=True, slots=True)
class Compared:
    """A step in a world: with the gains of `tune`, and as shipped."""

    seed: int
    step: str
    tuned: StepOutcome
    shipped: StepOutcome

    @property
    def sooner(self) -> bool:
        """Whether the tuned holds settle, and before the shipped ones."""
        return self.tuned.settled and self.tuned.settled_s < self.shipped.settled_s


def compare(vehicle: Vehicle, seed: int, world: str = POOL, steps: Sequence[SetpointStep] = STEPS) -> list[Compared]:
    """Fly a pool test in a world, tune, and fly the steps in the same world. HindraxError where the test was ended."""
    flight = fly(MOTIONS, seed, world, vehicle=vehicle)
    if flight.aborted:
        raise HindraxError(f"seed {seed}: {flight.aborted}")
    found = {name: one for name, one in flight.outcome.results.motions.items() if one.identifiable}
    saved = SavedCoefficients(f"seed {seed}", conditions_of(vehicle, mock=True), found)
    gains = hold_gains(saved, vehicle, f"seed {seed}", complete=True)
    made = []
    for step in steps:
        mine = step_flight(
            vehicle, gains.vehicle, step, holds=gains.holds, station=gains.station, world=world, seed=seed
        )
        made.append(Compared(seed, step.name, mine, step_flight(vehicle, vehicle, step, world=world, seed=seed)))
    return made


def main(words: Sequence[str]) -> int:
    """Fly the worlds and print a row for each; 1 when tuned holds do not settle, or settle later in over one in ten."""
    parser = argparse.ArgumentParser(prog="tuned_holds", description=__doc__.partition("\n")[0])
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--vehicle", default="hindrax")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(words)
    vehicle, made = vehicle_of(arguments.vehicle), list[Compared]()
    for seed in range(arguments.seed, arguments.seed + arguments.worlds):
        made += compare(vehicle, seed)
        print(f"world {seed}: {sum(one.sooner for one in made)} of {len(made)} settle sooner", file=sys.stderr)
    document = {
        "worlds": arguments.worlds,
        "steps": len(made),
        "sooner": sum(one.sooner for one in made),
        "never": sum(not one.tuned.settled for one in made),
        "never_as_shipped": sum(not one.shipped.settled for one in made),
    }
    if arguments.json:
        print(json.dumps(document, indent=2))
    else:
        rows = [(str(one.seed), one.step, _said(one.tuned), _said(one.shipped)) for one in made]
        print_table("Settled after", ("world", "step"), ("tuned [s]", "as shipped [s]"), rows)
        print(json.dumps(document))
    return int(document["never"] > 0 or document["sooner"] < 0.9 * document["steps"])


def _said(outcome: StepOutcome) -> str:
    return f"{outcome.settled_s:.1f}" if outcome.settled else "never"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
