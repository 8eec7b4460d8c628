"""A pool session: steps one after the other, one joint estimate over all, what each step bought and what the next can.

Each finished step is kept in `session.yaml`, so that a session goes on where it was interrupted. What could spoil the
day comes first: tether and thrusters. Legs come before weighings: a weighing improves the legs before it as well
(ADR 35), and their budget says what a weighing is worth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import yaml

from hindrax_analysis.identification.supply_at_rest import RestVolts
from hindrax_analysis.next_step import UNKNOWN, quoted_share
from hindrax_core.errors import UsageError, cause
from hindrax_core.text.refusals import NOTHING, Refusal, from_sentence
from hindrax_core.text.text_file import replace_text, writing
from hindrax_core.vehicle import AxisGain, Vehicle
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_ident.remedies import WEIGH_THRUST

SESSION_FILE = "session.yaml"
TETHER, THRUSTERS, LEGS, WEIGH = "tether", "thrusters", "legs", "weigh"
WEIGHED = ("surge", "sway", "heave", "yaw")
"""Axes with a known-weight test; roll and pitch carry a load by their righting moment."""
DRAG_GOAL, ROTATION_GOAL, MASS_GOAL = 0.05, 0.10, 0.08
"""Wanted calibrated standard deviations of the drag at the highest speed and of the added mass, shares of them [-]."""
TRIES_OF_LEGS = 2
TWICE = "aborted twice, by "
NOISE = "noise of the record"


@dataclass(frozen=True, slots=True)
class Reached:
    """Deviations of one motion with all influences, as shares of the drag at its highest speed and of its mass [-].

    `weighed`, `repeated`: of the drag at best after each, by the budget; `floor`: after both, with `cause` the largest
    influence that is left. NaN where the drag is not known.
    """

    drag: float
    added_mass: float
    weighed: float
    repeated: float
    floor: float
    cause: str
    remedy: str


def drag_goal(motion: str) -> float:
    """Wanted calibrated standard deviation of the drag at the highest speed, as a share of it [-]."""
    return ROTATION_GOAL if MOTIONS[motion].axis in (3, 4) else DRAG_GOAL


def reached_of(result: MotionResult) -> Reached:
    """Where a motion stands, and what a weighing and a repeat could buy at best by its budget.

    Variances of independent rows add up (GUM, JCGM 100, eq. 11a): a weighing takes those that WEIGH_THRUST remedies,
    a repeat half of that of the noise. Of the corrected numbers, which are those that are quoted: the rows are of the
    fit, and a correction takes of each the same part.

    Parameters
    ----------
    result
        Of the session so far.

    Returns
    -------
    Reached
        Shares of the drag at the highest speed, and of the added mass [-].
    """
    mass, drag = result.coefficients.get("added_mass"), result.drag
    mass_value, mass_std = mass.quoted if mass else (math.nan, math.nan)
    mass_share = abs(mass_std / mass_value) if mass_value else math.nan
    force, std = drag.quoted(-1) if drag else (math.nan, math.nan)
    if drag is None or not force > 0.0:
        return Reached(math.nan, mass_share, math.nan, math.nan, math.nan, "", "")
    variance, left_over = std**2, std / float(drag.std_calibrated[-1])
    rows = [replace(row, std=left_over * row.std) for row in result.budget.get("drag", ())]
    by_weighing = sum(row.std**2 for row in rows if row.remedy == WEIGH_THRUST)
    # A second run halves the variance of the noise; what acts on both alike stays.
    by_repeat = 0.5 * sum(row.std**2 for row in rows if row.influence == NOISE)
    left = [row for row in rows if row.remedy != WEIGH_THRUST and row.influence != NOISE]
    largest = max(left, key=lambda row: row.std, default=None)

    def share(gained: float) -> float:
        return math.sqrt(max(0.0, variance - gained)) / force

    return Reached(
        drag=share(0.0),
        added_mass=mass_share,
        weighed=share(by_weighing),
        repeated=share(by_repeat),
        floor=share(by_weighing + by_repeat),
        cause=largest.influence if largest else "",
        remedy=str(largest.remedy) if largest else "",
    )


@dataclass(frozen=True, slots=True)
class Step:
    """A finished step: its folder below the session, the gain that it found, water time, and where all stands now."""

    name: str
    folder: str = ""
    gain: AxisGain | None = None
    seconds: float = 0.0
    remark: str = ""
    """Why it was left out or is not whole; empty when it was done."""
    reached: Mapping[str, Reached] = field(default_factory=dict)
    volts: RestVolts | None = None
    """Supply at rest before and after what was flown, where a person read it."""

    @property
    def kind(self) -> str:
        """TETHER, THRUSTERS, LEGS or WEIGH."""
        return self.name.partition(" ")[0]

    @property
    def aborted(self) -> bool:
        """Whether they are legs of which no try was flown whole: only these have a remark."""
        return self.kind == LEGS and bool(self.remark)

    @property
    def subject(self) -> str:
        """Number of the legs, or axis that is weighed."""
        return self.name.partition(" ")[2]


@dataclass(frozen=True, slots=True)
class PoolSession:
    """Settings of a session, its planned steps by name, and those that are finished."""

    settings: Mapping[str, Any]
    planned: tuple[str, ...]
    done: tuple[Step, ...] = ()

    @property
    def left(self) -> tuple[str, ...]:
        """Names of the steps to do."""
        return self.planned[len(self.done) :]

    @property
    def gains(self) -> dict[str, AxisGain]:
        """What was weighed, by axis."""
        return {step.subject: step.gain for step in self.done if step.gain is not None}

    @property
    def folders(self) -> dict[str, RestVolts | None]:
        """Folders with a bag of legs, and their supply at rest."""
        return {step.folder: step.volts for step in self.done if step.kind == LEGS and step.folder}

    @property
    def reached(self) -> Mapping[str, Reached]:
        """Where every motion stands after the last estimate."""
        return next((step.reached for step in reversed(self.done) if step.reached), {})

    @property
    def aborted(self) -> Refusal:
        """Which legs were aborted, the last of them, and why; nothing when none were."""
        for step in reversed(self.done):
            if step.aborted:
                return from_sentence(step.remark.removeprefix(TWICE)).within(f"{step.name}: {TWICE}")
        return NOTHING

    @property
    def seconds(self) -> float:
        """Time in the water [s]."""
        return sum(step.seconds for step in self.done)

    def weighed(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with the gains of this session."""
        return replace(vehicle, thrust_gain={**vehicle.thrust_gain, **self.gains})


def planned_steps(motions: Sequence[str], repeats: int) -> tuple[str, ...]:
    """Names of the steps for the flown motions: what a person and the vehicle check, legs, weighings, repeated legs."""
    weighings = [f"{WEIGH} {axis}" for axis in WEIGHED if axis in motions]
    return (TETHER, THRUSTERS, f"{LEGS} 1", *weighings, *(f"{LEGS} {number}" for number in range(2, repeats + 1)))


def order_of(motions: Sequence[str], number: int) -> tuple[str, ...]:
    """Motions of the n-th legs: every second time backwards, so that a steady drift averages out over the repeats."""
    return tuple(motions) if number % 2 else tuple(reversed(motions))


class StepRunner(Protocol):
    """What does the steps: the stack with a person beside the pool, or the mock."""

    def tether(self) -> str:
        """Have the tether led away; why not, or nothing."""

    def thrusters(self, folder: Path, session: PoolSession) -> tuple[float, str]:
        """Have every thruster and sensor prove what the vehicle file says of it (ADR 48).

        Parameters
        ----------
        folder
            Of the run; it does not exist yet.
        session
            With all that was done before.

        Returns
        -------
        tuple[float, str]
            Seconds in the water, and what was not proven.

        Raises
        ------
        HindraxError
            Where the vehicle is not as its file says: no legs may follow.
        """

    def legs(self, motions: tuple[str, ...], folder: Path, session: PoolSession) -> tuple[float, str]:
        """Fly motions into a new folder.

        Parameters
        ----------
        motions
            In their order.
        folder
            Of the run; it does not exist yet.
        session
            With all that was done before.

        Returns
        -------
        tuple[float, str]
            Seconds in the water, and why it was aborted.
        """

    def weigh(self, axis: str, folder: Path, session: PoolSession) -> tuple[AxisGain | None, float, str]:
        """Weigh an axis.

        Parameters
        ----------
        axis
            One of AXES.
        folder
            Of the run; it does not exist yet.
        session
            With all that was done before.

        Returns
        -------
        tuple[AxisGain | None, float, str]
            Its gain, seconds in the water, and why there is none.
        """

    def volts(self) -> RestVolts | None:
        """Supply at rest before and after the last legs or weighing; None where nobody read it."""

    def estimate(self, bags: Mapping[Path, RestVolts | None], session: PoolSession) -> Mapping[str, Reached]:
        """One estimate over all bags, each at its supply, with all gains."""


def run_steps(
    session: PoolSession, folder: Path, runner: StepRunner, report: Callable[[PoolSession], None] = lambda _: None
) -> PoolSession:
    """Do the steps that are left; each is kept on disk when it is finished.

    A KeyboardInterrupt passes through: the step in hand is not kept, and is done again when the session goes on.

    Parameters
    ----------
    session
        As it was kept.
    folder
        Of the session.
    runner
        What does the steps.
    report
        Called with the session after each.

    Returns
    -------
    PoolSession
        With nothing left.
    """
    motions = tuple(session.settings["motions"])
    while session.left:
        step = _do(session.left[0], motions, session, folder, runner)
        session = replace(session, done=(*session.done, step))
        save(session, folder)
        # Weighings one after the other need one estimate, after the last.
        more = step.kind == WEIGH and session.left and session.left[0].startswith(WEIGH)
        if step.kind in {LEGS, WEIGH} and not more and session.folders:
            bags = {folder / name: volts for name, volts in session.folders.items()}
            reached = runner.estimate(bags, session)
            session = replace(session, done=(*session.done[:-1], replace(step, reached=reached)))
            save(session, folder)
        report(session)
    return session


def _do(name: str, motions: tuple[str, ...], session: PoolSession, folder: Path, runner: StepRunner) -> Step:
    step = Step(name)
    if step.kind == TETHER:
        return replace(step, remark=runner.tether())
    if step.kind == THRUSTERS:
        seconds, remark = runner.thrusters(place := _free(folder, name), session)
        return replace(step, folder=place.name, seconds=seconds, remark=remark)
    if step.kind == WEIGH:
        gain, seconds, remark = runner.weigh(step.subject, _free(folder, name), session)
        return replace(step, gain=gain, seconds=seconds, remark=remark, volts=runner.volts())
    seconds, aborted = 0.0, ""
    for _ in range(TRIES_OF_LEGS):
        place = _free(folder, name)
        took, aborted = runner.legs(order_of(motions, int(step.subject)), place, session)
        seconds += took
        if not aborted:
            break
    # Of legs that were aborted twice, what was flown counts.
    flown = place.name if (place / "bag").is_dir() else ""
    remark = f"{TWICE}{aborted}" if aborted else ""
    return Step(name, flown, seconds=seconds, remark=remark, volts=runner.volts())


def _free(folder: Path, name: str) -> Path:
    """A folder that no earlier try has: `legs-1`, then `legs-1-again`, and so on."""
    path = folder / name.replace(" ", "-")
    while path.exists():
        path = path.with_name(f"{path.name}-again")
    return path


# ---- on disk


def save(session: PoolSession, folder: Path) -> None:
    """Write `session.yaml`; HindraxError when that fails."""
    done = [asdict(step) for step in session.done]
    plain = {"settings": dict(session.settings), "planned": list(session.planned), "done": done}
    with writing(folder / SESSION_FILE):
        replace_text(folder / SESSION_FILE, yaml.safe_dump(plain, sort_keys=False))


def load(folder: Path) -> PoolSession:
    """Read `session.yaml`; UsageError says what is wrong with it."""
    file = folder / SESSION_FILE
    try:
        plain = yaml.safe_load(file.read_text(encoding="utf-8"))
        done = tuple(_step(one) for one in plain["done"])
        return PoolSession(plain["settings"], tuple(plain["planned"]), done)
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        raise UsageError(f"{file}: found no session ({cause(error)}), wanted one that pool-test wrote") from error


def _step(plain: Mapping[str, Any]) -> Step:
    gain = None if plain["gain"] is None else AxisGain(**plain["gain"])
    reached = {name: Reached(**one) for name, one in plain["reached"].items()}
    volts = RestVolts(**plain["volts"]) if plain.get("volts") else None
    return Step(**{**plain, "gain": gain, "reached": reached, "volts": volts})


# ---- in words


def meets(motion: str, reached: Reached) -> bool:
    """Whether drag and added mass of a motion are as well known as wanted."""
    return reached.drag <= drag_goal(motion) and reached.added_mass <= MASS_GOAL


def farthest_motion(session: PoolSession) -> str | None:
    """Motion that is farthest from its goal; None where all reached it, or none has a drag."""
    known = {motion: one for motion, one in session.reached.items() if math.isfinite(one.drag)}
    wide = {motion: one.drag / drag_goal(motion) for motion, one in known.items() if one.drag > drag_goal(motion)}
    return max(wide, key=wide.__getitem__, default=None)


def next_sentence(session: PoolSession) -> str:
    """What to do next by the budget: the motion that is farthest from its goal, and what a step buys there at best."""
    motion = farthest_motion(session)
    if motion is None:
        known = any(math.isfinite(one.drag) for one in session.reached.values())
        return "the drag of every motion is as well known as wanted" if known else "no motion has a drag yet"
    one, best = session.reached[motion], min(session.reached[motion].weighed, session.reached[motion].repeated)
    if best >= UNKNOWN:
        return f"the drag of {motion} stays unknown after a weighing or a repeat: fly it faster, or for longer"
    now = f"known to {quoted_share(one.drag)}" if one.drag < UNKNOWN else "unknown"
    at = f"{motion} is {now}, wanted {drag_goal(motion):.0%}"
    if session.left and best < 0.9 * one.drag:
        what = "the weighing" if one.weighed <= one.repeated else "a repeat"
        return f"{at}; {what} can buy {best:.1%} at best"
    return f"{at}; weighing and repeats end at {one.floor:.1%}, by {one.cause}: {one.remedy}"
