"""The comparison of tuned holds with shipped ones: how a world is judged; the flights are tested with `step_flight`."""

from collections.abc import Sequence

import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_sim.flights.step_flight import StepOutcome
from hindrax_tools import tuned_holds
from hindrax_tools.tuned_holds import Compared, main

SOON, LATE, NEVER = (
    StepOutcome(3.0, 0.0, settled=True),
    StepOutcome(5.0, 0.0, settled=True),
    StepOutcome(14.0, 1.0, settled=False),
)


@pytest.mark.parametrize(
    ("worlds", "code"),
    [
        ([(SOON, LATE)] * 10, 0),
        ([(SOON, LATE)] * 9 + [(LATE, SOON)], 0),
        ([(SOON, LATE)] * 8 + [(LATE, SOON)] * 2, 1),
        ([(SOON, LATE)] * 9 + [(NEVER, LATE)], 1),
        ([(SOON, NEVER)] * 10, 0),
    ],
)
def test_nine_of_ten_are_sooner_and_none_never(
    worlds: Sequence[tuple[StepOutcome, StepOutcome]],
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def compare(_vehicle: Vehicle, seed: int) -> list[Compared]:
        return [Compared(seed, "1 m along", *worlds[seed - 1])]

    monkeypatch.setattr(tuned_holds, "compare", compare)
    assert main(["--worlds", str(len(worlds))]) == code
    assert f'"steps": {len(worlds)}' in capsys.readouterr().out
