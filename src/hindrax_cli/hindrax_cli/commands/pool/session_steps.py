"""The steps of a guided session on the stack: each a flight of its own, with a person beside the pool or in mock."""

import argparse
import shlex
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hindrax_analysis.identification.bag_identification import Identified
from hindrax_analysis.identification.known_weight import SHARES, Hold, gain_or_reason
from hindrax_analysis.identification.known_weight import weigh as weighed
from hindrax_analysis.identification.pool_session import LEGS, TETHER, PoolSession, Reached, reached_of
from hindrax_analysis.identification.record_identification import IdentificationTask, identify_sources, open_sources
from hindrax_analysis.identification.supply_at_rest import RestVolts, gain_at_rest_volts
from hindrax_analysis.records.third_party_bag import TopicSelection
from hindrax_analysis.terminal import working
from hindrax_bag.run_folder import RunFolder, make_run_folder
from hindrax_bringup.stack import MockOptions
from hindrax_cli.commands.experiment.weigh import (
    LEVER_SIGMA_m,
    ask_for_load,
    entered,
    entered_line,
    forget_what_was_typed,
)
from hindrax_cli.commands.operate.commission import whole_table
from hindrax_cli.vehicle_edit import set_keys
from hindrax_control.commissioning.findings import TRIM, Findings
from hindrax_control.commissioning.record import proof, unproven
from hindrax_control.maneuver.goal import PLATEAUS
from hindrax_core.errors import HindraxError
from hindrax_core.text.refusals import NOTHING, STOPPED, Refusal, from_sentence
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.vehicle import AXES, AxisGain, load_vehicle
from hindrax_operator.commissioning_run import commission_beside
from hindrax_operator.pool_run import ABORT, FlownManeuver, PoolOptions, fly, planned, proof_of
from hindrax_operator.progress import Progress
from hindrax_operator.session_question import SessionQuestions

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

LOAD_SIGMA = 0.002
LEAD_AWAY = "lead the tether away: slack, afloat, its fixed end beside the middle of the legs, so that it pulls nowhere"
TAKE_OFF = "take the weight and its line off, and keep away from the thrusters"
AGAIN = "the last step was not flown to its end ({}): see to that, and keep away from the thrusters"
GO_ON = "a client goes on with the session: see that nobody is near the thrusters, which are armed next"
NOT_AS_ITS_FILE = "the vehicle is not as its file says ({}), so no legs are flown; {}"
READ_SUPPLY = "read the supply voltage at the battery, all thrusters at rest; type the volts, then press Enter"
RESTING = 0.75, 1.25
"""Limits of a supply at rest, as shares of the nominal one: a cell alone, or two in series, is another number [-]."""
TURN_S = 0.1


class StackStepRunner:
    """Flies with the stack, each step for itself; in mock the weighing is in lock-step, in the world of the legs."""

    def __init__(self, arguments: argparse.Namespace, session: PoolSession, folder: RunFolder) -> None:
        self._settings: Mapping[str, Any] = session.settings
        self._yes, self._file = arguments.yes, folder.vehicle
        self.vehicle = load_vehicle(folder.vehicle)
        mock = self._settings["mock"]
        self.options = PoolOptions(
            motions=tuple(self._settings["motions"]),
            vehicle_file=folder.vehicle,
            mock=MockOptions(mock["seed"], arguments.rate or 0.0, (), mock["world"]) if mock else None,
            out=None,
            seed=arguments.seed,
            excitation=PLATEAUS,
            on_cancel=arguments.on_cancel,
            without_record=ABORT,
            headless=arguments.headless or arguments.json,
            json=arguments.json,
            uncommissioned=arguments.uncommissioned,
        )
        self.questions = SessionQuestions(folder.path)
        self._say_plan()
        self.identified: Identified | None = None
        self._aborted = ""
        # Where a sensor measures the supply, the thrust in the bag is that of its voltage.
        self._reads_supply = not self._yes and not self.vehicle.measuring("supply")
        self._read_V: float | None = None
        self._volts: RestVolts | None = None

    def _say_plan(self) -> None:
        print_stderr(proof_of(self.vehicle, self.options).text)
        for line in planned(self.vehicle, self.options):
            print_stderr(line)

    def tether(self) -> str:
        """Ask for the tether to be led away."""
        self._await_enter(LEAD_AWAY)
        return ""

    def confirm(self, session: PoolSession) -> None:
        """Ask whether the vehicle may be armed, where a client goes on with a session whose tether was led away.

        Parameters
        ----------
        session
            As it goes on.
        """
        if session.left and session.left[0] != TETHER:
            self._await_enter(GO_ON)

    def _await_enter(self, sentence: str) -> None:
        """Ask for what arms when it is done: no client of the page or of the graph confirms it (ADR 18).

        In mock nobody is in the water, and with `--yes` nobody is at the terminal: then it goes on.
        """
        if self.options.mock is not None or self._yes:
            return
        forget_what_was_typed()
        print_stderr(f"{sentence}; then press Enter")
        self.questions.ask(sentence, arms=True)
        while not self._ready():
            time.sleep(TURN_S)

    def _ready(self) -> bool:
        """Whether the person has done what was asked, and says so here or on the page."""
        ready = self.questions.answered() or entered()
        if ready:
            self.questions.close()
        return ready

    def legs(self, motions: tuple[str, ...], folder: Path, _session: PoolSession) -> tuple[float, str]:
        """Fly motions.

        Parameters
        ----------
        motions, folder
            What is flown, and the folder of its run.
        _session
            As it stands; not needed.

        Returns
        -------
        tuple[float, str]
            Seconds in the water, and why it was aborted or did not start; empty when all was flown.

        Raises
        ------
        KeyboardInterrupt
            After a Ctrl-C has ended the flight in neutral: it ends the session.
        """
        made = make_run_folder(str(folder), self._file)
        self._confirm_after_abort()
        before_V = self._supply_V()
        flight = self._flown(LEGS, made, partial(fly, replace(self.options, motions=motions)))
        self._keep_volts(before_V, flight.vehicle_s)
        return flight.vehicle_s, self._aborted

    def volts(self) -> RestVolts | None:
        """Supply at rest before and after the last legs or weighing."""
        return self._volts

    def _supply_V(self) -> float | None:
        """Ask for the supply voltage at rest, until it is one; None where it is not read."""
        if self.options.mock is not None or not self._reads_supply:
            return None
        before_V, (low_V, high_V) = self._read_V, (part * self.vehicle.supply_V for part in RESTING)
        alone = "it cannot be read" if before_V is None else f"still {before_V:g} V"
        while text := self._typed(f"{READ_SUPPLY}; Enter alone: {alone}"):
            with suppress(ValueError):
                if low_V <= (volts := float(text.removesuffix("V"))) <= high_V:
                    self._read_V = volts
                    return volts
            print_stderr(f"found {text!r}, wanted the volts of the supply, {low_V:.3g} to {high_V:.3g}, such as 15.2")
        self._reads_supply = before_V is not None
        return before_V

    def _typed(self, sentence: str) -> str:
        """What is typed in answer, here: what the answer lets begin arms."""
        forget_what_was_typed()
        print_stderr(sentence)
        self.questions.ask(sentence, arms=True)
        while (line := entered_line()) is None:
            time.sleep(TURN_S)
        self.questions.close()
        return line

    def _keep_volts(self, before_V: float | None, flown_s: float) -> None:
        """Keep the supply before and after a flight."""
        self._volts = None
        if (mock := self._settings["mock"]) is not None and not self.vehicle.measuring("supply"):
            from hindrax_sim.conditions.world_table import rest_volts  # noqa: PLC0415  # no simulator on the vehicle

            self._volts = RestVolts(*rest_volts(self.vehicle, mock["world"], mock["seed"], flown_s))
        elif before_V is not None and flown_s > 0.0 and (after_V := self._supply_V()) is not None:
            self._volts = RestVolts(before_V, after_V)

    def _at_its_supply(self, gain: AxisGain | None) -> AxisGain | None:
        """A gain that was weighed with the thrust of the nominal voltage, at that of the last flight."""
        if gain is None or self._volts is None:
            return gain
        return gain_at_rest_volts(gain, self.vehicle, self._volts)

    def thrusters(self, folder: Path, _session: PoolSession) -> tuple[float, str]:
        """Commission the vehicle: a thruster that is fouled, dead or exchanged since spoils every leg.

        Parameters
        ----------
        folder
            Of the run.
        _session
            As it stands; not needed.

        Returns
        -------
        tuple[float, str]
            Seconds in the water, and what was not proven. The session takes a file that is proven now for commissioned.

        Raises
        ------
        HindraxError
            Where a claim of the file does not hold; with what mends it.
        KeyboardInterrupt
            As of `legs`.
        """
        made, found = make_run_folder(str(folder), self._file), list[Findings]()

        def act(_options: PoolOptions, operator: "Operator", progress: Progress) -> Refusal:
            found.append(commission_beside(operator, self.vehicle, progress.report, arm=True))
            if found[0].ended == STOPPED:
                raise KeyboardInterrupt
            return from_sentence(found[0].ended)

        flight = self._flown("the check of the thrusters", made, partial(fly, self.options, act=act, arm=False))
        return flight.vehicle_s, self._judged(found[0], made) if found else self._aborted

    def _judged(self, findings: Findings, folder: RunFolder) -> str:
        """Keep what was found; what was not proven, or HindraxError where the file is wrong."""
        table = folder.path / "commissioning.txt"
        table.write_text(whole_table(findings, [mend.line for mend in findings.mends]), encoding="utf-8")
        if wrong := [row for row in findings.wrong if row.claim != TRIM]:
            for row in wrong:
                print_stderr("; ".join(filter(None, (f"{row.claim}: {row.found}", row.remedy))))
            word = self._settings.get("vehicle", "")
            mend = shlex.join(["./hindrax", "commission", *(["--vehicle", word] if word else []), "--write"])
            how = f"`{mend}` mends it, with a stack; then begin a new session" if findings.mends else wrong[0].remedy
            raise HindraxError(f"{table}: {NOT_AS_ITS_FILE.format(', '.join(row.claim for row in wrong), how)}")
        record = proof(self.vehicle, findings, str(folder.bag), datetime.now(UTC).date().isoformat())
        if record is not None and unproven(self.vehicle) and self.options.mock is None:
            set_keys(self._file, [(("commissioned",), asdict(record))])
            self.vehicle = load_vehicle(self._file)
            self._say_plan()
        return "" if findings.complete else findings.sentence

    def _flown(
        self, what: str, made: RunFolder, flight: Callable[[RunFolder, Progress], FlownManeuver]
    ) -> FlownManeuver:
        """Fly a step that arms by itself; what did not start has no flight, and its reason is that of an abort."""
        self._confirm_after_abort()
        try:
            with Progress(headless=self.options.headless) as progress:
                flown = flight(made, progress)
        except HindraxError as error:  # before it was armed: nothing was flown, and the next try may start
            shutil.rmtree(made.bag, ignore_errors=True)
            print_stderr(f"{what} did not start: {error}")
            self._aborted = str(error)
            return FlownManeuver()
        if flown.interrupted:
            raise KeyboardInterrupt
        self._aborted = str(flown.aborted)
        return flown

    def _confirm_after_abort(self) -> None:
        """Ask before anything is armed after an abort, whose remedy is often a person's, at the vehicle."""
        if self._aborted:
            self._await_enter(AGAIN.format(self._aborted))
        self._aborted = ""

    def weigh(self, axis: str, folder: Path, _session: PoolSession) -> tuple[AxisGain | None, float, str]:
        """Weigh with the stack and a person, or in lock-step.

        Parameters
        ----------
        axis, folder
            What is weighed, and the folder of its run.
        _session
            As it stands; not needed.

        Returns
        -------
        tuple[AxisGain | None, float, str]
            Gain of the thrust, None without one; seconds in the water; why there is none.

        Raises
        ------
        KeyboardInterrupt
            As of `legs`.
        """
        if (mock := self._settings["mock"]) is not None:
            from hindrax_cli.commands.pool.lockstep_session import weigh_in_lockstep  # noqa: PLC0415  # no simulator on the vehicle

            with working(f"weighing {axis} in lock-step, in the world of the legs"):
                gain, seconds, reason = weigh_in_lockstep(self.vehicle, axis, mock["world"], mock["seed"])
            self._keep_volts(None, seconds)
            return self._at_its_supply(gain), seconds, reason
        load_N, lever_m = self._settings["load_N"], self._settings["lever_m"] if axis == "yaw" else 1.0
        if self._yes or not load_N or not lever_m:
            self._volts = None
            return None, 0.0, "left out: wanted a person, --load and for yaw --lever"
        self._confirm_after_abort()
        before_V = self._supply_V()
        held: list[Hold] = []

        def act(_options: PoolOptions, operator: "Operator", progress: Progress) -> Refusal:
            from hindrax_operator.weighing import weigh_on  # noqa: PLC0415  # rclpy reads the environment of the stack

            loads = [share * load_N * lever_m for share in SHARES]
            ask = partial(ask_for_load, axis, load_N, say=self.questions.ask)
            asked = AXES.index(axis), loads
            held.extend(weigh_on(operator, self.vehicle, *asked, ready=self._ready, ask=ask, report=progress.report))
            return NOTHING

        made = make_run_folder(str(folder), self._file)
        with Progress(headless=True) as progress:
            flight = fly(replace(self.options, motions=(axis,)), made, progress, act)
        if flight.interrupted:
            print_stderr(TAKE_OFF)
            raise KeyboardInterrupt
        self._await_enter(TAKE_OFF)
        self._keep_volts(before_V, flight.vehicle_s)
        if flight.aborted or not held:
            return None, flight.vehicle_s, f"aborted by {flight.aborted}"
        sigma = (LOAD_SIGMA**2 + ((LEVER_SIGMA_m / lever_m) ** 2 if axis == "yaw" else 0.0)) ** 0.5
        gain, reason = gain_or_reason(partial(weighed, held, AXES.index(axis), self.vehicle, load_sigma=sigma))
        return self._at_its_supply(gain), flight.vehicle_s, reason

    def estimate(self, bags: Mapping[Path, RestVolts | None], session: PoolSession) -> Mapping[str, Reached]:
        """One estimate over all legs, each at its supply, with all gains."""
        self.identified = self.identify(bags, session)
        return {motion: reached_of(one) for motion, one in self.identified.results.motions.items()}

    def identify(self, bags: Mapping[Path, RestVolts | None], session: PoolSession) -> Identified:
        """Identify over the bags of these folders together, each at its supply."""
        found = open_sources([folder / "bag" for folder in bags], TopicSelection())
        sources = [replace(one, volts=volts) for one, volts in zip(found, bags.values(), strict=True)]
        vehicle = session.weighed(self.vehicle)
        with working("one estimate over all legs") as reached:
            return identify_sources(sources, vehicle, IdentificationTask(), reached=reached)
