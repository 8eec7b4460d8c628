"""A commissioning, without ports and clock: pulses to fly out, readings in, findings at the end.

    work = Commissioning(vehicle)
    work.on_reading(source, reading); work.on_forces(stamp, forces_N)      # all the time
    work.rest(stamp, stamp)                                                # before arming, afloat and still
    while (pulses := work.next_pulses(now)) is not None: fly Goal((), pulses=pulses)
    # where a flight was aborted: work.gentler(now, aborted), or finalize(aborted)
    findings = work.finalize()

Before arming, gravity says whether the inertial sensor is turned out of the vertical, and the DVL and the sonar whether
they see the floor. Where gravity is wrong nothing is armed: the attitude is false then, and the vehicle would refuse.
Nor is anything where the vehicle lists so far that no room is left for a swing: it is trimmed first.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix, effectiveness
from hindrax_control.commissioning import sensor_claims
from hindrax_control.commissioning.dead_bands import YAW, DeadBandLadder
from hindrax_control.commissioning.findings import MEASURED, OPEN, PROVEN, TRIM, WRONG, Finding, Findings, Mend
from hindrax_control.commissioning.hypotheses import RIGHT_TURNS, TURNED, Wiring, explain, turn_of
from hindrax_control.commissioning.probes import body_pulses, single_pulses
from hindrax_control.commissioning.recording import Recording
from hindrax_control.commissioning.response import (
    AFTER_S,
    BEFORE_S,
    Answer,
    MotionView,
    Prior,
    Window,
    grid,
    lagged,
)
from hindrax_control.maneuver.goal import Pulse
from hindrax_control.maneuver.pulses import MOST_LEAN_rad, MOST_LIST_rad
from hindrax_core.events import Stamp, Stamped, to_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Reading
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.vehicle import Vehicle

Model: TypeAlias = tuple[Matrix, tuple[Matrix, Matrix]]
"""Times (n,); accelerations and rates (n, 6)."""
UPRIGHT = 0.8
"""Cosine of the largest tilt at rest that is trim; a right angle is a mount."""
GENTLE, ROOM_rad = 0.5, math.radians(8.0)
"""Of the usual force of single thrusters, the least; and the room for a swing from which on the force is the usual."""
LEVEL_deg = 5.0
"""List about an axis up to which nothing is said of how to trim it."""
QUIET_N = 0.05
"""Force below which a thruster stands still."""
LAGS_S = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45)
SURE = 0.9
"""Likelihood from which on a wiring is told as found."""
BROKEN_S = 0.5
"""Rest of a thruster within its pulses beyond which they are two attempts."""
LEAST_BUSY = 5
"""Samples of forces without which pulses were not flown."""


class Commissioning:
    """One commissioning of one vehicle file."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self.recording = vehicle, Recording()
        self.B = effectiveness(vehicle)
        self._prior = Prior(vehicle)
        self._claimed_lag_s = float(np.median([one.lag_s for one in vehicle.thrusters])) if vehicle.thrusters else 0.15
        self._lag_s = self._claimed_lag_s
        self._rest: Window | None = None
        self._round = 0
        self._gentle = self._singles_again = self._doubts_again = self._again = False
        self._begun_s = 0.0
        self._ladder: DeadBandLadder | None = None
        self._ladder_s = self._rung_s = np.inf
        """When the dead bands were begun with, and the last pulses for them."""
        self.turn: Matrix = np.eye(3)
        """Correction of the inertial sensor: body as it is from body as its mount says."""
        self.wirings: tuple[Wiring, ...] = ()
        self.answers: dict[int, Answer] = {}
        self.ended = ""
        self._seen: dict[Window, MotionView] = {}
        self._models: dict[tuple[Window, float], Model] = {}

    # ---- what comes in

    def on_reading(self, source: str, reading: Stamped[Reading]) -> None:
        """Keep a reading of a sensor of the vehicle file."""
        self.recording.on_reading(source, reading)

    def on_forces(self, stamp: Stamp, forces_N: Sequence[float]) -> None:
        """Keep the forces of the thrusters by the curves of the file, from this stamp on [N]."""
        self.recording.on_forces(stamp, forces_N)

    def rest(self, begin: Stamp, end: Stamp) -> None:
        """Say when the vehicle floated at rest, disarmed."""
        self._rest = Window(to_s(begin), to_s(end))

    # ---- what is to be flown

    def next_pulses(self, now: Stamp) -> tuple[Pulse, ...] | None:
        """Pulses to fly now; None when all was flown, or nothing may be."""
        self._round += 1
        if self._round == 1:
            self._begun_s = to_s(now)
            return single_pulses(self.vehicle, self.B, share=self._share) if self.fit else None
        if self._round == 2 and not self.ended:
            self._judge_thrusters()
            if doubtful := self._doubtful_pulses():
                self._round = 1
                return doubtful
            return self._body_pulses(now, self._listing_rad())
        if not (self.ended or self._again) and self._as_claimed and self._left_open:
            self._again = True
            return self._body_pulses(now, math.inf if self._gentle else self._listing_rad())
        return None if self.ended or not self._as_claimed else self._dead_band_pulses(now)

    def _dead_band_pulses(self, now: Stamp) -> tuple[Pulse, ...] | None:
        """Pulses for the dead bands, after everything else: the bodies' motions judge the sensors without them."""
        if self._ladder is None:
            self._ladder, self._ladder_s = DeadBandLadder(self.vehicle, self.found), to_s(now)
        pulses = self._ladder.climb(self._share_turned)
        self._rung_s = to_s(now)
        return pulses

    def _share_turned(self) -> tuple[float, float]:
        """Turn of the last pulses, as a share of what they should have turned, and its deviation; NaN unknown."""
        at_s, rows = self.recording.forces.between(self._rung_s, np.inf)
        busy = at_s[(np.abs(rows) > QUIET_N).any(axis=1)] if len(rows) else np.zeros(0)
        if len(busy) < LEAST_BUSY:
            return np.nan, np.nan
        window = Window(busy[0] - BEFORE_S, busy[-1] + AFTER_S)
        view, times_s = MotionView(self.recording, window, self._offset()), grid(window)
        if not view.known:
            return np.nan, np.nan
        wrench = lagged(times_s, self.recording.forces, window, self._lag_s) @ self.found.T
        answer = self._answer(self.turn, view, (times_s, self._prior.respond(times_s, wrench)))
        return float(answer.wrench[YAW]), float(answer.sigma[YAW])

    def gentler(self, now: Stamp, aborted: Refusal) -> tuple[Pulse, ...] | None:
        """Pulses once more, more gently, where the vehicle tilted too far.

        On a busy computer pulses end late, and swing a vehicle further than planned although all is as claimed. Of
        single thrusters those are pulsed again that did not run to their end, at half the force; the whole body at half
        the lean, but not where a thruster is not as claimed.

        Parameters
        ----------
        now
            Time of the vehicle.
        aborted
            Why the flight ended.

        Returns
        -------
        tuple[Pulse, ...] | None
            None where that is no help.
        """
        if aborted.reason is not Reason.COMMISSION:
            return None
        if self._round == 1 and not self._singles_again:
            self._singles_again = True
            return self._single_pulses_left()
        if self._gentle or self._round != 2 or not self._as_claimed:
            return None
        self._gentle = True
        return self._body_pulses(now, math.inf)

    def _single_pulses_left(self) -> tuple[Pulse, ...] | None:
        """Pulses of the thrusters from the one on that was at work last, at half the force where it still turns."""
        last, _ = max(self._windows(), key=lambda one: one[1].begin_s, default=(0, None))
        left = [one for one in single_pulses(self.vehicle, self.B, share=GENTLE) if not any(one.forces_N[:last])]
        return tuple(left) or None

    def _doubtful_pulses(self) -> tuple[Pulse, ...]:
        """Pulses, once more, of thrusters whose answer explains nothing surely: a swing or the tether disturbed it."""
        if self._doubts_again:
            return ()
        self._doubts_again = True
        doubtful = [index for index in self.answers if self.wirings[index].likelihood < SURE]
        pulses = single_pulses(self.vehicle, self.B, share=GENTLE if self._singles_again else self._share)
        return tuple(one for one in pulses if any(one.forces_N[index] for index in doubtful))

    @property
    def _as_claimed(self) -> bool:
        """Whether every thruster was pulsed and pushes as its file says."""
        rows = self._thruster_claims()
        return bool(self.wirings) and not [one for one in rows if one.verdict in (WRONG, OPEN)]

    @property
    def _left_open(self) -> bool:
        """Whether a sensor sends, and what it sent so far shows nothing: more of the same motions may."""
        return any(row.verdict == OPEN and not row.remedy for row in sensor_claims.claims(self._evidence()))

    def _body_pulses(self, now: Stamp, listing_rad: float) -> tuple[Pulse, ...] | None:
        sunk_m = self._sunk_m(to_s(now))
        return body_pulses(self.vehicle, self.found, sunk_m=sunk_m, listing_rad=listing_rad) or None

    def _listing_rad(self) -> float:
        """Angle between the vertical of the body and gravity at rest."""
        down = self._down()
        return 0.0 if down is None else float(np.arccos(np.clip(down[2], -1.0, 1.0)))

    def _sunk_m(self, now_s: float) -> float:
        """How much deeper it is than at rest; 0 where nothing shows it."""
        water, pressure = self.vehicle.water, self.recording.first_pressure
        _, before = pressure.between(self._rest.begin_s, self._rest.end_s) if self._rest else (0, np.zeros((0, 1)))
        _, after = pressure.between(now_s - 1.0, now_s + 1.0)
        if not (len(before) and len(after)):
            return 0.0
        return float(after[:, 0].mean() - before[:, 0].mean()) / (water.density_kgpm3 * GRAVITY_mps2)

    @property
    def _share(self) -> float:
        """Of the usual force of single thrusters: less where the list at rest leaves less room for their swing."""
        room_rad = MOST_LEAN_rad - self._listing_rad()
        return max(GENTLE, min(1.0, room_rad / ROOM_rad))

    @property
    def fit(self) -> bool:
        """Whether it may be pulsed: upright, and with a list that leaves room for a swing."""
        return self.upright and self._listing_rad() <= MOST_LIST_rad

    @property
    def upright(self) -> bool:
        """Whether gravity is where the mount of the inertial sensor has it, with the vehicle at rest."""
        down = self._down()
        return down is not None and float(down[2]) > UPRIGHT

    @property
    def found(self) -> Matrix:
        """Effectiveness (6, n) by output, as it was found."""
        return np.column_stack([wiring.column(self.B) for wiring in self.wirings])

    # ---- what follows

    def finalize(self, ended: str = "") -> Findings:
        """Everything that was found; `ended`: why the flight ended early."""
        self.ended = self.ended or ended
        if self.upright and not self.wirings and self._windows():
            self._judge_thrusters()
        rows = [*self._inertial_claims(), *self._thruster_claims()]
        bands = tuple(self._ladder.findings()) if self._ladder is not None else ()
        first = any(row.verdict == WRONG for row in bands)
        rows += [_doubted(row) if first else row for row in sensor_claims.claims(self._evidence())]
        rows += bands
        names = [one.name for one in self.vehicle.thrusters]
        wrenches = {names[at]: tuple(map(float, one.wrench)) for at, one in self.answers.items()}
        return Findings(tuple(rows), self.ended, wrenches)

    def _evidence(self) -> sensor_claims.Evidence:
        return sensor_claims.Evidence(
            self.vehicle,
            self.recording,
            self._prior,
            self._rest,
            self.turn,
            self.upright,
            self._body_windows(),
            [window for _, window in self._windows()],
            self.found if self.wirings else np.zeros((6, 0)),
            self._lag_s,
            self._offset(),
        )

    # ---- the inertial sensor

    def _mount(self) -> Matrix:
        source = self.recording.inertial.source
        mount = self.vehicle.sensors.get(source)
        return turn_of(mount.rotation_deg) if mount else np.eye(3)

    def _lever_m(self) -> Matrix:
        mount = self.vehicle.sensors.get(self.recording.inertial.source)
        return np.subtract(mount.position_m, self.vehicle.center_of_mass_m) if mount else np.zeros(3)

    def _down(self) -> Matrix | None:
        """Direction of gravity at rest in body axes by the mount of the file; None without a rest."""
        if self._rest is None:
            return None
        _, rows = self.recording.inertial.between(self._rest.begin_s, self._rest.end_s)
        if len(rows) < 20:
            return None
        mean = self._mount() @ rows[:, :3].mean(axis=0)
        return np.asarray(-mean / (float(np.linalg.norm(mean)) or 1.0))

    def _offset(self) -> Matrix:
        """Offset of the gyroscope at rest, in the sensor's axes."""
        if self._rest is None:
            return np.zeros(3)
        _, rows = self.recording.inertial.between(self._rest.begin_s, self._rest.end_s)
        return rows[:, 3:].mean(axis=0) if len(rows) else np.zeros(3)

    def _inertial_claims(self) -> list[Finding]:
        source, down = self.recording.inertial.source, self._down()
        mount = self.vehicle.sensors.get(source)
        if mount is None or down is None:
            return [Finding("inertial sensor", OPEN, "on board", "sends nothing at rest", remedy="`./hindrax doctor`")]
        claim, claimed = f"{source} mount", str(list(mount.rotation_deg))
        if not self.upright:
            # Of the turns that bring gravity back, the one by the smallest angle; what it is about the vertical, the
            # pulses show once this is mended.
            turn = max(RIGHT_TURNS, key=lambda one: (round(float((one @ down)[2]), 3), float(np.trace(one))))
            return [sensor_claims.turned(source, mount, turn, "gravity comes from the side or from above")]
        roll_deg, pitch_deg = (float(np.degrees(np.arctan2(down[1], down[2]))), float(np.degrees(-np.arcsin(down[0]))))
        trim = Finding(TRIM, MEASURED, "level", f"roll {roll_deg:+.1f}, pitch {pitch_deg:+.1f} deg")
        if not self.fit:
            trim = replace(trim, verdict=WRONG, remedy=_trim_remedy(roll_deg, pitch_deg))
        if not self.wirings:
            return [Finding(claim, OPEN, claimed, "upright; nothing was pulsed to show more"), trim]
        if np.allclose(self.turn, np.eye(3)):
            return [Finding(claim, PROVEN, claimed, "gravity, rates and pulses agree"), trim]
        return [sensor_claims.turned(source, mount, self.turn, "the vehicle turns and moves otherwise"), trim]

    # ---- the thrusters

    def _windows(self) -> list[tuple[int, Window]]:
        """Index and window of each thruster that ran alone."""
        at_s, rows = self.recording.forces.between(self._begun_s, np.inf)
        found: list[tuple[int, Window]] = []
        running = np.abs(rows) > QUIET_N if len(rows) else np.zeros((0, 0), bool)
        alone = np.where(running.sum(axis=1) == 1, running.argmax(axis=1), -1) if len(rows) else np.zeros(0, int)
        together = running.sum(axis=1) > 1 if len(rows) else np.zeros(0, bool)
        for index in range(len(self.vehicle.thrusters)):
            mine = np.flatnonzero(alone == index)
            stop = np.flatnonzero(together)
            mine = mine[mine < stop[0]] if len(stop) else mine
            if len(mine):  # one that was ended, and pulsed again, counts by its last pulses
                mine = mine[np.flatnonzero(np.diff(at_s[mine], prepend=-np.inf) > BROKEN_S)[-1] :]
            if len(mine) > 5:
                found.append((index, Window(at_s[mine[0]] - BEFORE_S, at_s[mine[-1]] + AFTER_S)))
        return found

    def _body_windows(self) -> list[Window]:
        """Windows in which more than one thruster ran, each from rest to rest."""
        at_s, rows = self.recording.forces.between(self._begun_s, self._ladder_s)
        alone = self._windows()
        since = max((window.end_s for _, window in alone), default=self._begun_s) - AFTER_S + 0.1
        busy = at_s[(np.abs(rows) > QUIET_N).any(axis=1) & (at_s > since)] if len(rows) else np.zeros(0)
        windows: list[Window] = []
        for moment in busy:
            if windows and moment - windows[-1].end_s < sensor_claims.JOINED_S - AFTER_S:
                windows[-1] = Window(windows[-1].begin_s, moment + AFTER_S)
            else:
                windows.append(Window(moment - BEFORE_S, moment + AFTER_S))
        return windows

    def _judge_thrusters(self) -> None:
        """Choose the turn of the inertial sensor and the wiring of every output that explain all answers together."""
        windows = self._windows()
        turns = [turn for turn in RIGHT_TURNS if turn[2, 2] > 0.5]
        # Once with the lag of the file, to know who moves; then the lag that fits them best.
        best = max((self._explained(turn, windows, self._claimed_lag_s) for turn in turns), key=lambda one: one[0])
        self.turn = best[1]
        lags = {lag_s: self._misfit(windows, lag_s) for lag_s in (*LAGS_S, self._claimed_lag_s)}
        self._lag_s = min(lags, key=lambda one: lags[one])
        _, self.turn, self.wirings, self.answers = self._explained(self.turn, windows, self._lag_s)

    def _explained(
        self, turn: Matrix, windows: Sequence[tuple[int, Window]], lag_s: float
    ) -> tuple[float, Matrix, tuple[Wiring, ...], dict[int, Answer]]:
        answers = {index: self._answer(turn, view, model) for index, view, model in self._views(windows, lag_s)}
        wirings = tuple(
            explain(index, answers[index], self.B) if index in answers else Wiring(None, 1, 0.0)
            for index in range(len(self.vehicle.thrusters))
        )
        beforehand = 0.0 if np.allclose(turn, np.eye(3)) else TURNED
        return beforehand + sum(wiring.log for wiring in wirings), turn, wirings, answers

    def _views(self, windows: Sequence[tuple[int, Window]], lag_s: float) -> Iterator[tuple[int, MotionView, Model]]:
        """Motion in each window, and what the prior makes of one newton in the course of the thruster's force."""
        for index, window in windows:
            view = self._seen.get(window) or MotionView(self.recording, window, self._offset())
            self._seen[window] = view
            if (window, lag_s) not in self._models:
                at_s = grid(window)
                force = lagged(at_s, self.recording.forces, window, lag_s)[:, index]
                self._models[window, lag_s] = (at_s, self._prior.respond(at_s, force))
            if view.known:
                yield index, view, self._models[window, lag_s]

    def _answer(self, turn: Matrix, view: MotionView, model: Model) -> Answer:
        return view.answer(turn @ self._mount(), self._lever_m(), *model)

    def _misfit(self, windows: Sequence[tuple[int, Window]], lag_s: float) -> float:
        return sum(self._answer(self.turn, view, model).misfit for _, view, model in self._views(windows, lag_s))

    def _thruster_claims(self) -> list[Finding]:
        if not self.wirings:
            unpulsed = [(one.name, f"channel {one.channel}") for one in self.vehicle.thrusters]
            return [Finding(name, OPEN, claimed, "was not pulsed") for name, claimed in unpulsed]
        rows = [self._thruster_claim(index) for index in range(len(self.wirings))]
        lags = sorted({one.lag_s for one in self.vehicle.thrusters})
        claimed = ", ".join(f"{lag_s:g} s" for lag_s in lags)
        return [*rows, Finding("lag of the thrusters", MEASURED, claimed, f"{self._lag_s:g} s, roughly")]

    def _thruster_claim(self, index: int) -> Finding:
        thrusters, wiring = self.vehicle.thrusters, self.wirings[index]
        mine = thrusters[index]
        claimed = f"channel {mine.channel}{', reversed' if mine.reversed else ''}"
        share = f"{100.0 * wiring.strength:.0f} % of its curve"
        if index not in self.answers:
            return Finding(mine.name, OPEN, claimed, "was not pulsed")
        if wiring.drives is None:
            remedy = "look for a loose cable, a blocked propeller, a controller without power"
            if all(one.drives is None for one in self.wirings):
                remedy += "; or the dead bands are wider than these pulses: none of them pushes"
            return Finding(mine.name, WRONG, claimed, "does not push", wiring.likelihood, remedy)
        if wiring.likelihood < SURE:
            return Finding(mine.name, OPEN, claimed, "its pulses explain nothing surely", wiring.likelihood)
        other = thrusters[wiring.drives]
        if wiring.drives == index and wiring.sign > 0:
            found = f"pushes as claimed, {share}"
            return Finding(mine.name, PROVEN, claimed, found, wiring.likelihood)
        backwards = " backwards" if wiring.sign < 0 else ""
        what = (
            f"pushes{backwards}" if wiring.drives == index else f"channel {mine.channel} drives {other.name}{backwards}"
        )
        mends = []
        if wiring.drives != index:
            mends.append(Mend(("thrusters", other.name, "channel"), mine.channel))
        reversed_now = mine.reversed is not (wiring.sign < 0)
        if reversed_now is not other.reversed:
            mends.append(Mend(("thrusters", other.name, "reversed"), reversed_now))
        return Finding(mine.name, WRONG, claimed, f"{what}, {share}", wiring.likelihood, mends=tuple(mends))


def _trim_remedy(roll_deg: float, pitch_deg: float) -> str:
    """Where weight must go: away from the side that hangs."""
    sides = {"starboard": -roll_deg, "port": roll_deg, "the bow": pitch_deg, "the stern": -pitch_deg}
    wanted = " and ".join(side for side, by_deg in sides.items() if by_deg > LEVEL_deg)
    return f"trim it to {math.degrees(MOST_LIST_rad):.0f} deg at the most: weight to {wanted}"


def _doubted(row: Finding) -> Finding:
    """A claim of a sensor where dead bands are wider than the file says: what moved it was not what was asked for.

    The sag of the supply is by voltage and current alone, whatever moves.
    """
    if row.verdict != WRONG or row.claim == sensor_claims.SAG:
        return row
    return replace(row, verdict=OPEN, mends=(), remedy="mend the dead bands first, and commission again")
