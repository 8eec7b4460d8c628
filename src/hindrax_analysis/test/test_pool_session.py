"""A pool session by a stand-in of the flights: order, repeats, keeping, going on, and what a step can buy."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.pool_session import (
    MASS_GOAL,
    PoolSession,
    Reached,
    Step,
    load,
    meets,
    next_sentence,
    order_of,
    planned_steps,
    reached_of,
    run_steps,
    save,
)
from hindrax_analysis.identification.supply_at_rest import RestVolts
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AxisGain
from hindrax_ident.assess.results import Contribution, Corrected, DragBand, Interval, MotionResult, Number
from hindrax_ident.remedies import WEIGH_THRUST, Remedy

VOLTS = RestVolts(16.1, 15.2)
GAIN = AxisGain(load=15.0, sigma=0.004, positive=0.94, negative=0.95)


class StandIn:
    """Says what it is asked to do; `aborts` and `interrupts` are taken one after the other."""

    def __init__(self, *, aborts: Sequence[str] = (), interrupt_at: int = -1) -> None:
        self.asked: list[str] = []
        self.bags: list[list[str]] = []
        self._aborts, self._interrupt_at = list(aborts), interrupt_at

    def _ask(self, what: str) -> None:
        if len(self.asked) == self._interrupt_at:
            raise KeyboardInterrupt
        self.asked.append(what)

    def tether(self) -> str:
        self._ask("tether")
        return ""

    def thrusters(self, _folder: Path, _session: PoolSession) -> tuple[float, str]:
        self._ask("thrusters")
        return 50.0, ""

    def legs(self, motions: tuple[str, ...], folder: Path, _session: PoolSession) -> tuple[float, str]:
        (folder / "bag").mkdir(parents=True)
        self._ask(f"{folder.name} {' '.join(motions)}")
        return 60.0, self._aborts.pop(0) if self._aborts else ""

    def weigh(self, axis: str, _folder: Path, _session: PoolSession) -> tuple[AxisGain | None, float, str]:
        self._ask(f"weigh {axis}")
        return GAIN, 250.0, ""

    def volts(self) -> RestVolts | None:
        return VOLTS

    def estimate(self, bags: Mapping[Path, RestVolts | None], session: PoolSession) -> Mapping[str, Reached]:
        assert set(bags.values()) == {VOLTS}
        self.bags.append([bag.name for bag in bags])
        drag = 0.2 / (1.0 + len(session.gains) + len(bags))
        return {"surge": Reached(drag, 0.05, 0.5 * drag, 0.9 * drag, 0.04, "inflow loss", "coast")}


def session_of(*motions: str, repeats: int = 2) -> PoolSession:
    return PoolSession({"motions": list(motions)}, planned_steps(motions, repeats))


def test_legs_come_first_and_one_estimate_follows_all_weighings(tmp_path: Path) -> None:
    stand = StandIn()
    done = run_steps(session_of("surge", "roll", "yaw"), tmp_path, stand)
    legs = ["legs-1 surge roll yaw", "legs-2 yaw roll surge"]
    assert stand.asked == ["tether", "thrusters", legs[0], "weigh surge", "weigh yaw", legs[1]]
    assert stand.bags == [["legs-1"], ["legs-1"], ["legs-1", "legs-2"]]
    assert done.gains == {"surge": GAIN, "yaw": GAIN}
    assert [step.name for step in done.done if step.volts == VOLTS] == list(done.planned[2:])
    assert done.seconds == 50.0 + 60.0 + 250.0 + 250.0 + 60.0
    assert [step.name for step in done.done if step.reached] == ["legs 1", "weigh yaw", "legs 2"]


@pytest.mark.parametrize("at", range(5))
def test_an_interrupted_session_goes_on_with_the_step_in_hand(tmp_path: Path, at: int) -> None:
    first, second = StandIn(interrupt_at=at), StandIn()
    save(session_of("surge"), tmp_path)
    with pytest.raises(KeyboardInterrupt):
        run_steps(load(tmp_path), tmp_path, first)
    done = run_steps(load(tmp_path), tmp_path, second)
    kinds = [one.partition(" ")[0] for one in (*first.asked, *second.asked)]
    # The folder of the broken try stays, beside that of the step.
    names = [one.removesuffix("-again") for one in kinds]
    assert names == ["tether", "thrusters", "legs-1", "weigh", "legs-2"]
    assert load(tmp_path) == done
    assert not done.left


@pytest.mark.parametrize(
    ("aborts", "folder", "remark"),
    [(["guard: tilt"], "legs-1-again", ""), (["a", "b"], "legs-1-again", "aborted twice, by b")],
)
def test_aborted_legs_are_flown_once_more_or_said(tmp_path: Path, aborts: list[str], folder: str, remark: str) -> None:
    done = run_steps(session_of("surge", repeats=1), tmp_path, StandIn(aborts=aborts))
    legs = done.done[2]
    assert (legs.folder, legs.remark, legs.seconds) == (folder, remark, 120.0)
    assert legs.aborted is bool(remark)
    assert not Step("weigh surge", remark="aborted by the operator").aborted, "legs are what is flown"


def test_what_is_no_session_is_said(tmp_path: Path) -> None:
    (tmp_path / "session.yaml").write_text("[1, 2]", encoding="utf-8")
    with pytest.raises(UsageError, match=r"session\.yaml: found no session"):
        load(tmp_path)


def result(force: float, rows: Mapping[str, tuple[float, str]]) -> MotionResult:
    std = math.sqrt(sum(one**2 for one, _ in rows.values()))
    speed, forces, stds = np.array([0.1, 0.5]), np.array([1.0, force]), np.array([1.0, std])
    return MotionResult(
        motion="surge",
        method="output-error",
        coefficients={"added_mass": Number(10.0, 0.1, 0.5)},
        identifiable=True,
        drag=DragBand(speed, forces, stds, stds),
        budget={"drag": [Contribution(name, one, remedy) for name, (one, remedy) in rows.items()]},
    )


def test_what_a_step_can_buy_is_what_its_rows_take_of_the_variance(tmp_path: Path) -> None:
    rows = {"thrust calibration": (4.0, WEIGH_THRUST), "noise of the record": (2.0, ""), "own wake": (4.0, "rest")}
    found = reached_of(result(100.0, rows))
    assert found.drag == pytest.approx(0.06)
    assert found.added_mass == pytest.approx(0.05)
    assert found.weighed == pytest.approx(math.sqrt(20.0) / 100.0)
    assert found.repeated == pytest.approx(math.sqrt(34.0) / 100.0)
    assert found.floor == pytest.approx(math.sqrt(18.0) / 100.0)
    assert (found.cause, found.remedy) == ("own wake", "rest")
    whole = reached_of(result(100.0, {"own wake": (4.0, Remedy("rest", "./hindrax wait"))}))
    session = PoolSession({"motions": ["surge"]}, ("legs 1",), (Step("legs 1", reached={"surge": whole}),))
    save(session, tmp_path)
    assert load(tmp_path).done[0].reached["surge"].remedy == "rest", "YAML knows no other kind of text"
    assert math.isnan(reached_of(result(-1.0, rows)).drag)


def test_a_session_stands_where_the_corrected_numbers_stand() -> None:
    rows = {"thrust calibration": (4.0, WEIGH_THRUST), "own wake": (4.0, "rest"), "inflow loss": (7.0, "coast")}
    fitted = result(100.0, rows)
    assert fitted.drag is not None
    ends = (np.array([1.0, 82.0]), np.array([1.0, 88.0]), np.array([1.0, 76.0]), np.array([1.0, 92.0]))
    band = replace(fitted.drag, corrected=Interval(np.array([1.0, 80.0]), *ends))
    mass = replace(fitted.coefficients["added_mass"], corrected=Corrected(8.0, (7.8, 8.2), (7.6, 8.4)))
    found = reached_of(replace(fitted, drag=band, coefficients={"added_mass": mass}))
    assert found.drag == pytest.approx(3.0 / 80.0)
    assert found.weighed == pytest.approx(3.0 / 80.0 * math.sqrt(65.0 / 81.0))
    assert found.added_mass == pytest.approx(0.2 / 8.0)


def test_the_next_step_is_the_cheapest_for_the_motion_farthest_from_its_goal() -> None:
    wide = Reached(0.2, 0.05, 0.1, 0.19, 0.09, "inflow loss", "coast")
    began = session_of("surge", "roll")
    session = after_legs(began, {"surge": wide, "roll": wide})
    assert next_sentence(session).startswith("surge is known to 20.0%, wanted 5%; the weighing can buy 10.0%")
    finished = replace(session, planned=session.planned[: len(session.done)])
    assert next_sentence(finished).endswith("end at 9.0%, by inflow loss: coast")
    vague = after_legs(began, {"surge": replace(wide, drag=3.2)})
    assert next_sentence(vague).startswith("surge is unknown, wanted 5%; the weighing can buy 10.0%")
    lost = after_legs(began, {"surge": replace(wide, drag=42.79, weighed=10.99, repeated=31.0)})
    assert (
        next_sentence(lost)
        == "the drag of surge stays unknown after a weighing or a repeat: fly it faster, or for longer"
    )
    good = replace(wide, drag=0.04)
    assert "as well known as wanted" in next_sentence(after_legs(began, {"surge": good}))
    assert meets("surge", good)
    assert not meets("surge", replace(good, added_mass=2.0 * MASS_GOAL))


def after_legs(session: PoolSession, reached: Mapping[str, Reached]) -> PoolSession:
    return replace(session, done=(Step("tether"), Step("thrusters"), Step("legs 1", "legs-1", reached=reached)))


def test_every_second_repeat_is_flown_backwards() -> None:
    assert [order_of(("surge", "yaw"), number) for number in (1, 2, 3)] == [
        ("surge", "yaw"),
        ("yaw", "surge"),
        ("surge", "yaw"),
    ]
