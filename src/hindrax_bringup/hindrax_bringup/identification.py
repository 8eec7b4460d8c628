"""Identification over a finished bag of ours, and how its results are written and shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from hindrax_bringup.commands._experiment import console
from hindrax_bringup.events import bag_events
from hindrax_bringup.result_files import bag_conditions, traces_of, write_coefficients, write_report
from hindrax_bringup.run_folder import RunFolder
from hindrax_core.events import Stamp
from hindrax_core.vehicle import Vehicle
from hindrax_ident.models import MOTIONS
from hindrax_ident.report import RunReport, published_of
from hindrax_ident.results import DragBand, Results, with_truth
from hindrax_ident.session import Outcome, Session
from hindrax_ident.tuning import Tuning


@dataclass(frozen=True, slots=True)
class Identified:
    """What a bag says of the vehicle."""

    outcome: Outcome
    results: Results
    mock: bool
    origin: Stamp | None = None
    """When the times of the outcome begin."""

    @property
    def complete(self) -> bool:
        """Whether at least one motion was flown and every one is identifiable."""
        motions = self.results.motions
        return bool(motions) and all(one.identifiable for one in motions.values())

    def document(self, folder: RunFolder, factor: float, aborted: str | None) -> dict[str, Any]:
        """The JSON document of `pool-test`."""
        ends = {"bag": str(folder.bag), "report": str(folder.report), "real_time_factor": factor, "aborted": aborted}
        return {**self.results.to_json(), **ends}


def identify_bag(bag: Path, vehicle: Vehicle, *, mock: bool = False, tuning: Tuning | None = None) -> Identified:
    """Run the session over a bag of ours; in mock the truth of the plant stands beside each number."""
    session = Session(vehicle, tuning)
    origin: Stamp | None = None
    for event in bag_events(bag, vehicle):
        origin = event.stamp if origin is None else min(origin, event.stamp)
        session.step(event)
    outcome = session.conclude()
    results = with_truth(outcome.results, vehicle) if mock else outcome.results
    return Identified(outcome, results, mock, origin)


def show(identified: Identified) -> None:
    """Print the table: each coefficient beside the simulated truth and the paper's; below it what cannot be told."""
    motions = identified.results.motions
    table = Table(title="Identified coefficients (SI, SNAME axes)", title_justify="left")
    truths = ("truth of the mock",) if identified.mock else ()
    name = identified.results.vehicle.name
    papers = ("COB-2023-1394",) if any(published_of(name, motion) for motion in motions) else ()
    for heading in ("motion", "", "value", "+-", "calibrated +-", *truths, *papers):
        table.add_column(heading, justify="left" if heading in ("motion", "") else "right", no_wrap=True)
    for motion, result in motions.items():
        published = published_of(name, motion)
        paper = published.in_our_axes if published else {}
        for key, number in result.coefficients.items():
            truth = () if not identified.mock else ("" if number.truth is None else f"{number.truth:.2f}",)
            printed = f"{paper[key][0]:.2f} +- {paper[key][1]:.2f}" if key in paper else ""
            row = (motion, key, f"{number.value:.3f}", f"{number.std:.3f}", f"{number.std_calibrated:.3f}")
            table.add_row(*row, *truth, *((printed,) if papers else ()))
    console().print(table)
    for motion, result in motions.items():
        if not result.identifiable:
            print(f"{motion}: not identifiable")
            print("".join(f"  {reason}\n" for reason in result.reasons), end="")
            if result.drag is not None:
                print(f"  {_band(result.drag, turns=MOTIONS[motion].axis >= 3)}")


def _band(drag: DragBand, *, turns: bool) -> str:
    """Drag force at the ends of the speeds that were flown, as far as it is known."""
    speed_unit, unit = ("rad/s", "N m") if turns else ("m/s", "N")
    ends = [
        f"{drag.force[at]:.3g} +- {drag.std_calibrated[at]:.2g} {unit} at {drag.speed[at]:.2g} {speed_unit}"
        for at in (0, -1)
    ]
    return f"drag: {', '.join(ends)}"


def identify_run(folder: RunFolder, vehicle: Vehicle, *, mock: bool) -> Identified:
    """Identify over the bag of a run and write its coefficients and its report."""
    identified = identify_bag(folder.bag, vehicle, mock=mock)
    write_results(identified, folder, vehicle)
    return identified


def write_results(identified: Identified, folder: RunFolder, vehicle: Vehicle) -> None:
    """Write `coefficients.yaml` and `report.html`."""
    told = bag_conditions(folder.bag, vehicle, identified.results, mock=identified.mock)
    write_coefficients(folder.coefficients, identified.results, told)
    traces = traces_of(folder.bag, identified.origin)
    outcome = identified.outcome
    write_report(folder.report, RunReport(vehicle, identified.results, outcome.conclusions, told, traces))
