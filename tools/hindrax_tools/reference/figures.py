"""The figures of the explanation, drawn from the vehicle file and from pool tests in lock-step that lie beside them."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.goal import Goal
from hindrax_core.events import Stamped
from hindrax_core.signals import Estimate
from hindrax_core.vehicle import Hydrodynamics, load_vehicle
from hindrax_ident.online.session import Session
from hindrax_sim.flights.lockstep import Lockstep
from hindrax_sim.flights.pool_flight import GoalPilot
from hindrax_sim.world import Conditions

FLIGHTS_FILE = "flights.json"
LONGEST_S = 3600.0
EVERY = 40
"""Of the online estimates every so many are kept: a figure has no more points."""
MEASURED, MODEL, SECOND, TRUTH = "#33658a", "#d1495b", "#6c9a3b", "#222222"
TWO_SIDED_95 = 1.96
HIGHEST_mps = 0.45
PLATEAUS = 6
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "hindrax",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.9",
    "axes.spines.top": False,
    "axes.spines.right": False,
}
Flights = Sequence[Mapping[str, Any]]


FLIGHTS = tuple((seed, gain) for gain in (1.0, 1.03) for seed in range(1, 9))
"""Pool tests in surge: seed of everything random, and true thrust over the thrust that the curve promises."""


def flown(seed: int, thrust_gain: float) -> dict[str, Any]:
    """Fly one and keep its coefficients, and what was known of them on the way."""
    vehicle = load_vehicle(default_vehicle())
    session = Session(vehicle)
    pilot = GoalPilot(vehicle, Goal(("surge",), "plateaus", seed))
    conditions = Conditions(sizes={"thrust_gain": thrust_gain - 1.0})
    steps = Lockstep(vehicle, pilot, seed, conditions=conditions, session=session).run(LONGEST_S)
    online = [event for event in steps if isinstance(event, Stamped) and isinstance(event.reading, Estimate)]
    result = session.finalize().results.motions["surge"]
    found = {
        name: [round(one, 5) for one in (number.value, number.std, number.std_calibrated)]
        for name, number in result.coefficients.items()
    }
    return {"seed": seed, "thrust_gain": thrust_gain, "found": found, "online": list(_course(online))}


def _course(online: list[Stamped[Any]]) -> Iterator[dict[str, Any]]:
    """Time since the first estimate, values and deviations, thinned."""
    first = online[0].stamp
    for one in online[::EVERY]:
        estimate: Estimate = one.reading
        deviations = [round(estimate.covariance[i][i] ** 0.5, 4) for i in range(len(estimate.names))]
        values = [round(value, 4) for value in estimate.values]
        yield {"time_s": round((one.stamp - first) * 1e-9, 2), "values": values, "stds": deviations}


def draw(folder: Path) -> list[Path]:
    """Draw every figure into a folder that holds the flights; returns the files."""
    flights: Flights = json.loads((folder / FLIGHTS_FILE).read_text(encoding="utf-8"))
    drawn = []
    with mpl.rc_context(STYLE):
        for name, make in FIGURES.items():
            figure = make(flights)
            FigureCanvasSVG(figure)
            drawn.append(folder / f"{name}.svg")
            figure.savefig(drawn[-1], metadata={"Date": None, "Creator": None})
    return drawn


def _figure(columns: int, height: float = 3.0) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(7.6, height), layout="constrained")
    return figure, [figure.add_subplot(1, columns, column + 1) for column in range(columns)]


def _truth() -> Hydrodynamics:
    found = load_vehicle(default_vehicle()).hydrodynamics
    assert found is not None
    return found


def learning(flights: Flights) -> Figure:
    """What the vehicle knew of its drag while it flew, in one run."""
    figure, axes = _figure(2)
    drag = _truth()
    course = [one for one in flights[0]["online"] if max(one["stds"][:2]) < 1e2]
    time = np.array([one["time_s"] for one in course])
    rows = (("$k_q$ [N s²/m²]", drag.surge.k_q, 20.0), ("$k_l$ [N s/m]", drag.surge.k_l, 8.0))
    for index, (axis, (label, truth, room)) in enumerate(zip(axes, rows, strict=True)):
        value = np.array([one["values"][index] for one in course])
        band = TWO_SIDED_95 * np.array([one["stds"][index] for one in course])
        axis.fill_between(time, value - band, value + band, color=MEASURED, alpha=0.25, lw=0, label="95 % interval")
        axis.plot(time, value, color=MEASURED, label="online estimate")
        axis.axhline(truth, color=TRUTH, ls="--", lw=1.2, label="truth of the mock")
        axis.set(xlabel="time [s]", ylabel=label, ylim=(truth - room, truth + room))
    axes[0].legend(frameon=False, fontsize=9)
    return figure


def speeds(_flights: Flights) -> Figure:
    """How well plateaus at some speeds separate quadratic from linear drag: least squares, one newton of noise each."""
    figure, (axis,) = _figure(1)
    ratios = np.linspace(0.05, 0.95, 91)
    shares = np.array([_shares(ratio) for ratio in ratios])
    names = (("quadratic part, $k_q v^2$", MODEL), ("linear part, $k_l v$", MEASURED), ("drag, their sum", SECOND))
    for column, (label, color) in enumerate(names):
        axis.plot(ratios, shares[:, column], color=color, label=label)
    axis.set(xlabel="lowest over highest speed flown [-]", ylabel="deviation at the highest speed [N]", yscale="log")
    axis.legend(frameon=False, fontsize=9)
    return figure


def _shares(ratio: float) -> list[float]:
    """Deviations of quadratic part, linear part and drag at the highest speed [N]."""
    one_way = np.linspace(ratio, 1.0, PLATEAUS) * HIGHEST_mps
    v = np.concatenate([one_way, -one_way])
    design = np.column_stack([v * np.abs(v), v, np.ones_like(v)])
    covariance = np.linalg.inv(design.T @ design)
    top = (np.array([HIGHEST_mps**2, 0, 0]), np.array([0, HIGHEST_mps, 0]), np.array([HIGHEST_mps**2, HIGHEST_mps, 0]))
    return [float(np.sqrt(row @ covariance @ row)) for row in top]


def calibration(flights: Flights) -> Figure:
    """Many runs with a good thrust curve, and with one that promises too little: noise and calibration."""
    figure, axes = _figure(2, 3.2)
    truth = _truth()
    gains = sorted({one["thrust_gain"] for one in flights})
    for axis, gain in zip(axes, gains, strict=True):
        own = [one for one in flights if one["thrust_gain"] == gain]
        for row, one in enumerate(own):
            value, std, calibrated = one["found"]["k_q"]
            axis.plot(
                [value - TWO_SIDED_95 * calibrated, value + TWO_SIDED_95 * calibrated], [row, row], color="0.7", lw=2
            )
            axis.plot([value - TWO_SIDED_95 * std, value + TWO_SIDED_95 * std], [row, row], color=MODEL, lw=5)
            axis.plot([value], [row], "o", color=MODEL, ms=4)
        axis.axvline(truth.surge.k_q, color=TRUTH, ls="--", lw=1.2)
        promise = "as the curve" if gain == 1.0 else f"{100 * (gain - 1):.0f} % above the curve"
        axis.set(title=f"true thrust {promise}", xlabel="$k_q$ of surge [N s²/m²]", xlim=(60, 73))
        axis.set_yticks(range(len(own)), [f"run {one['seed']}" for one in own])
        axis.invert_yaxis()
    return figure


def curve(_flights: Flights) -> Figure:
    """The thrust curve of the vehicle file: where it was measured, mirrored, and the dead band between."""
    figure, (axis,) = _figure(1)
    main = load_vehicle(default_vehicle()).curves["main"]
    pulses = np.linspace(main.negative.from_us, main.negative.to_us, 100)
    forces = np.array([main.negative.force_N(pulse) for pulse in pulses])
    axis.plot(pulses, forces, color=MODEL, label="as published (COB-2023-1394, Table 2)")
    axis.plot(2 * main.stop_us - pulses, -forces, color=MODEL, ls="--", label="its mirror image, assumed")
    band = (main.stop_us - main.dead_band_us, main.stop_us + main.dead_band_us)
    axis.axvspan(*band, color="0.85", lw=0, label="dead band")
    for side in (-1.0, 1.0):
        wide = 1.0 + side * TWO_SIDED_95 * main.gain_sigma
        axis.plot(pulses, wide * forces, color="0.6", lw=0.8)
        axis.plot(2 * main.stop_us - pulses, -wide * forces, color="0.6", lw=0.8)
    axis.set(xlabel="pulse [us]", ylabel="thrust [N]")
    axis.legend(frameon=False, fontsize=9)
    return figure


FIGURES: Mapping[str, Callable[[Flights], Figure]] = {
    "learning": learning,
    "speeds": speeds,
    "calibration": calibration,
    "curve": curve,
}
