"""How well the holds hold and how soon they settle, with the model in the vehicle file and without.

With it, feed-forward of mass and drag and all gains are of the identified vehicle, once `./hindrax export --to vehicle`
has written them there. Without it, displaced volume and a box of its envelope stand in. Lock-step in an ideal world.
"""

from dataclasses import asdict, replace

from hindrax_bringup.share_files import default_vehicle
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_sim.flights.step_flight import EACH_S, STEPS, SetpointStep, StepOutcome, step_flight


def rows() -> list[dict[str, object]]:
    """A row per vehicle and step: settling time and hold error with the model, beside those without it."""
    vehicles = [load_vehicle(file) for file in sorted(default_vehicle().parent.glob("*.yaml"))]
    return [_row(vehicle, step) for vehicle in vehicles for step in STEPS]


def _row(vehicle: Vehicle, step: SetpointStep) -> dict[str, object]:
    known, unknown = (
        step_flight(vehicle, vehicle, step),
        step_flight(vehicle, replace(vehicle, hydrodynamics=None), step),
    )
    return {
        "name": f"{vehicle.name}, {step.name}: {_text(known, step)}",
        "peer": f"without the model: {_text(unknown, step)}",
        "ratio": unknown.settled_s / known.settled_s,
        "with": asdict(known),
        "without": asdict(unknown),
    }


def _text(found: StepOutcome, step: SetpointStep) -> str:
    settled = f"settled in {found.settled_s:.1f} s" if found.settled else f"not settled in {EACH_S:.0f} s"
    return f"{settled}, hold error {found.error * step.scale:.3f} {step.unit}"
