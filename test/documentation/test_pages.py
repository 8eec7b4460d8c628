"""What the documentation says exists: commands are taken, links lead somewhere, examples are good."""

import re
from pathlib import Path

import pytest
from documentation.pages import PAGES, ROOT, Command, block_of, commands_of, links_of, paths_of

from hindrax_bringup.share_files import simulated_vehicle
from hindrax_cli import command_line
from hindrax_cli.command_line import main
from hindrax_control.allocation.thrust_curve import AppliedWrench, pulses_of_channels
from hindrax_core.thrust.curves import running
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_sim.hardware import Hardware
from hindrax_tools import ardusub

HOW_TO = ROOT / "docs" / "how-to"
BY_THE_SCRIPT = ("setup",)
MADE_BY_THE_READER = "lps22hb"
"""The sensor that a how-to adds."""
COMMANDS = [command for page in PAGES for command in commands_of(page)]


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("command", COMMANDS, ids=lambda one: f"{name(one.page)}: {one.line}")
def test_every_command_is_taken(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "myrov.yaml").touch()
    monkeypatch.chdir(tmp_path)
    first, *rest = command.words
    if first in BY_THE_SCRIPT or first.startswith("-"):
        return
    parser = command_line.parser_of(command_line.load(first))
    if "--help" not in rest:
        parser.parse_args(rest)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in links_of(page):
        if "://" not in link:
            assert (page.parent / link).exists(), f"{name(page)}: {link} is missing"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_path_is_there(page: Path) -> None:
    for path in paths_of(page):
        if MADE_BY_THE_READER not in path:
            assert (ROOT / path).exists(), f"{name(page)}: {path} is missing"


def test_the_file_of_ardusubs_simulator_has_its_thrust() -> None:
    """As its source has it: 51.48 N times the square of (pulse - 1500) / 400, none within 25 us."""
    vehicle = load_vehicle(simulated_vehicle())
    assert vehicle.net_buoyancy_N == pytest.approx(10.5 / 16.755, rel=1e-3)
    for name_of, gain in (("horizontal", 2.0**0.5), ("vertical", 1.0)):
        curve = running(vehicle.curves[name_of])
        for pulse_us in (1100.0, 1474.0, 1475.0, 1490.0, 1525.0, 1526.0, 1541.0, 1900.0):
            share = (pulse_us - 1500.0) / 400.0 * (abs(pulse_us - 1500.0) > 25.0)
            assert curve.force_N(pulse_us) == pytest.approx(gain * 51.48 * share * abs(share), abs=1e-4)


def test_every_page_can_be_reached_from_the_overview() -> None:
    overview = ROOT / "docs" / "README.md"
    reached = {(overview.parent / link).resolve() for link in links_of(overview)}
    for page in PAGES:
        if page.parent.name not in ("adr", ROOT.name, "docs"):
            assert page.resolve() in reached, f"docs/README.md has no link to {name(page)}"


def test_the_readme_is_a_screen_and_a_half() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 75
    assert max(map(len, lines)) <= 130


def test_the_vehicle_file_of_the_how_to_flies_in_mock_by_the_how_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Identification takes the first block; the mock takes it with the second and with what `estimate` prints."""
    file, page = tmp_path / "myrov.yaml", HOW_TO / "new-vehicle.md"
    text = block_of(page, "myrov.yaml")
    file.write_text(text, encoding="utf-8")
    assert load_vehicle(file).net_buoyancy_N == pytest.approx(0.98, abs=0.01)
    text += block_of(page, "thrusters and sensors")
    file.write_text(text, encoding="utf-8")
    assert main(["estimate", "--vehicle", str(file)]) == 0
    _, key, block = capsys.readouterr().out.partition("hydrodynamics:")
    file.write_text(text + key + block, encoding="utf-8")
    assert main(["vehicle", "check", str(file)]) == 0
    vehicle = load_vehicle(file)
    hardware = Hardware(vehicle, seed=1)
    assert set(hardware.serial) | set(hardware.registers) == set(vehicle.sensors)


def test_the_sweep_of_the_how_to_gives_a_curve(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sweep.csv").write_text(block_of(HOW_TO / "calibrate-thrusters.md", "sweep.csv"), encoding="utf-8")
    fit = next(one for one in commands_of(HOW_TO / "calibrate-thrusters.md") if "fit" in one.words)
    assert main(fit.words) == 0
    printed = capsys.readouterr().out
    assert re.search(r"negative:\n +c: \[", printed)
    assert Path("curve.png").stat().st_size > 10_000


def test_the_bluerov_of_the_how_to_is_pushed_where_ardusub_wants_it_to_go(tmp_path: Path) -> None:
    """Signs and numbers of the outputs against ArduSub's own table; all else is the vehicle that comes with us."""
    file = tmp_path / "bluerov.yaml"
    file.write_text(block_of(HOW_TO / "bluerov2-on-ardusub.md", "bluerov.yaml"), encoding="utf-8")
    vehicle, ours = load_vehicle(file), load_vehicle(ardusub.HEAVY)
    applied = AppliedWrench(vehicle)
    for name in ardusub.COLUMNS:
        pulses = [*ardusub.outputs(name, 0.5), *[0] * 8]
        wrench = applied.wrench(applied.forces_N(pulses_of_channels(vehicle, pulses)))
        wanted = -1.0 if name == "heave" else 1.0
        assert wrench[AXES.index(name)] * wanted > 1.0
        others = [wrench[AXES.index(other)] for other in ardusub.COLUMNS if other != name]
        assert others == pytest.approx([0.0] * 3, abs=1e-9)
    assert [one.position_m for one in vehicle.thrusters] == [one.position_m for one in ours.thrusters]
    same = ("mass_kg", "volume_m3", "envelope_m", "inertia_kgm2", "center_of_buoyancy_m", "supply_V")
    assert all(getattr(vehicle, one) == getattr(ours, one) for one in same)
    for pulse in range(1100, 1901, 50):
        forces = [AppliedWrench(one).forces_N([pulse] * 8) for one in (vehicle, ours)]
        assert forces[0] == pytest.approx(forces[1], rel=0.03, abs=0.2)  # a cubic here, a table there
