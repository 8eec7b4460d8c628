"""How long time waits for a control loop that is late."""

from pathlib import Path

import pytest

from hindrax_core.events import Stamp, seconds_between
from hindrax_core.vehicle import Vehicle
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import FREE_LAG_S, SLOW, Governor, MockVehicle

STEP_S = 0.005
REPEATED = Stamp(90_000_000)
"""The output repeats neutral this long after its last write, without any control loop."""


def test_a_late_loop_holds_time_back_only_while_a_thruster_turns() -> None:
    assert Governor(turns=True).least_wall_s(STEP_S, REPEATED, Stamp(0)) == SLOW * STEP_S
    starting = Governor(turns=False)
    assert starting.least_wall_s(STEP_S, REPEATED, Stamp(0)) == STEP_S
    assert starting.worst_lag_s == 0.0
    assert starting.least_wall_s(STEP_S, Stamp(round(FREE_LAG_S * 1e9)), Stamp(0)) == 0.0


def test_a_mock_knows_whether_a_thruster_turns(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        for pulse_us, turns in ((1500.0, False), (1700.0, True), (1500.0, False)):
            monkeypatch.setattr(mock.hardware.output, "pulses_us", lambda pulse_us=pulse_us: (pulse_us,) * 16)
            mock.step()
            assert mock.governor.turns is turns


def test_a_mock_that_waits_for_nobody_keeps_its_rate(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Governor(rate=1.0, waits=False).least_wall_s(STEP_S, REPEATED, Stamp(0)) == STEP_S
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=100.0, waits=False) as mock:
        monkeypatch.setattr(mock._server, "busy", lambda: pytest.fail("it asks who is late"))
        mock.step()
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=100.0) as mock:
        monkeypatch.setattr(mock._server, "busy", lambda: pytest.fail("it asks who is late"))
        with pytest.raises(pytest.fail.Exception):
            mock.step()


def test_longer_steps_keep_the_rate_too(vehicle: Vehicle, tmp_path: Path) -> None:
    """The devices of the virtual vehicle ran four times too fast: 20 ms of theirs in 5 ms."""
    paced: list[float] = []

    class Coarse(MockVehicle):
        step_s = 0.02

    class Noted(Governor):
        def least_wall_s(self, step_s: float, now: Stamp, last_write: Stamp | None) -> float:
            paced.append(step_s)
            return super().least_wall_s(step_s, now, last_write)

    with Coarse(Hardware(vehicle, 1), tmp_path, rate=1.0, waits=False) as mock:
        mock.governor = Noted()
        before = mock.hardware.stamp
        mock.step()
        assert set(paced) == {seconds_between(before, mock.hardware.stamp)} == {Coarse.step_s}
