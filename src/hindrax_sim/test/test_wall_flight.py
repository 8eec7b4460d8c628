"""A vehicle without a DVL flies surge by a sonar that looks at the wall ahead, and is identified by its ranges."""

from dataclasses import replace

from vehicles_beside import vehicle_beside

from hindrax_control.maneuver.plan import PlanKnobs
from hindrax_control.pilot import PilotKnobs
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_sim.conditions.world_table import IDEAL
from hindrax_sim.flights.pool_flight import fly

SHORT = PlanKnobs(levels=2, repeats=(1,) * 6, surge_mps=(0.25, 0.5), plateau_s=3.0)


def by_sonar() -> Vehicle:
    hindrax = vehicle_beside()
    rest = {name: mount for name, mount in hindrax.sensors.items() if name not in hindrax.measuring("velocity")}
    ahead = Mount("ping1d", port="/dev/hindrax/ahead", position_m=(0.25, 0.0, 0.0), rotation_deg=(0.0, 90.0, 0.0))
    return replace(hindrax, sensors={**rest, "ahead": ahead})


def test_surge_is_flown_and_identified_by_ranges_alone() -> None:
    flight = fly(("surge",), 4, IDEAL, vehicle=by_sonar(), knobs=PilotKnobs(plan=SHORT))
    assert not flight.aborted
    outcome = flight.outcome
    record = outcome.assessments[0].record
    assert not len(record.velocity)
    assert len(record.position) > 300
    found_N, std_N = outcome.results.motions["surge"].drag_force(0.5)
    true_N = flight.drag_N("surge", 0.5)
    assert abs(found_N - abs(true_N)) < 3.0 * std_N
    assert std_N < 0.05 * abs(true_N)
