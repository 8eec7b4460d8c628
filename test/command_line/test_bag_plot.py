"""`./hindrax bag plot` of a record of ours."""

from pathlib import Path

import pytest

from hindrax_cli import command_line

BAGS = Path(__file__).parents[1] / "replay/bags"


@pytest.mark.parametrize(("field", "unit"), [("depth", " [m]"), ("surge_velocity", " [m/s]"), ("header.stamp.sec", "")])
def test_a_plot_has_the_unit_that_the_message_names(field: str, unit: str, tmp_path: Path) -> None:
    out, name = tmp_path / "x.svg", f"/hindrax/navigation/status:{field}"
    bag = BAGS / "surge_estimates"
    assert command_line.main(["bag", "plot", str(bag), name, "--out", str(out)]) == 0
    assert f"<!-- {name}{unit} -->" in out.read_text()
