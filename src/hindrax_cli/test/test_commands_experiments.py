"""The bench experiment commands as an operator uses them: words in, tables or one JSON document out, exit codes."""

import errno
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap_ros2.writer import Writer

from hindrax_bringup.share_files import default_vehicle
from hindrax_cli import command_line
from hindrax_ident.arrays import Array, array
from hindrax_laboratory import pendulum, step

CFD = (6.204, 12.416, 18.636, 24.864, 31.1, 37.344, 43.596, 49.856, 56.124, 62.40)
CELL = ["--load-cell-std", "0.02"]
BENCH = ["--mass", "0.39", "--volume", "0.00056", "--stiffness", "1127.7"]


def write_csv(path: Path, **columns: Array) -> str:
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(f"{v:.9g}" for v in row) for row in rows)]))
    return str(path)


def plot(folder: Path, name: str) -> list[str]:
    return ["--plot", str(folder / f"{name}.svg")]


def decay() -> tuple[Array, Array]:
    """Acceleration of a free decay with m_ad = 0.8289 kg and zeta = 0.06, at 330 Hz."""
    time = array(np.arange(3300) / 330.0)
    natural, zeta = np.sqrt(1127.7 / (0.39 + 0.8289)), 0.06
    damped = natural * np.sqrt(1.0 - zeta**2)
    return time, -(natural**2) * 0.02 * np.exp(-zeta * natural * time) * (
        np.cos(damped * time) - zeta * np.sin(damped * time)
    )


def run_json(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    code = command_line.main([*words, "--json"])
    out = capsys.readouterr().out
    assert code == 0
    found: dict[str, Any] = json.loads(out)
    return found


def test_papers_json_has_the_agreed_shape(capsys: pytest.CaptureFixture[str]) -> None:
    cells = run_json(capsys, "papers")["cells"]
    wanted = {"paper", "table", "row", "quantity", "printed", "recomputed", "verdict", "note"}
    assert all(wanted <= set(cell) for cell in cells)
    assert {cell["verdict"] for cell in cells} == {"agrees", "misprint", "does not follow"}
    row = [
        c
        for c in cells
        if c["paper"] == "B" and c["row"].startswith("heave 20 mm, k = 1127.7") and c["quantity"] == "m_ad (5)"
    ]
    assert [(c["table"], c["printed"], round(c["recomputed"], 4), c["verdict"]) for c in row] == [
        ("4", 0.8289, 0.8355, "misprint")
    ]


def test_papers_table_names_every_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["papers"]) == 0
    out = capsys.readouterr().out
    assert "misprint" in out
    assert "does not follow" in out


def test_free_decay_from_an_accelerometer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time, acceleration = decay()
    file = write_csv(tmp_path / "a.csv", time_s=time, acceleration_mps2=acceleration + 9.81 + 0.02 * time)
    image = tmp_path / "a.png"
    found = run_json(capsys, "free-decay", file, *BENCH, "--prototype-volume", "0.0153", "--plot", str(image))
    assert found["added_mass_kg"]["value"] == pytest.approx(0.8289, rel=0.005)
    assert found["prototype_added_mass_kg"]["value"] == pytest.approx(22.65, rel=0.005)
    assert image.read_bytes().startswith(b"\x89PNG")


def test_free_decay_from_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time, acceleration = decay()
    bag = tmp_path / "bag.mcap"
    with bag.open("wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z\n")
        for t, a in zip(time, acceleration, strict=True):
            stamp = int(1e9 * t)
            writer.write_message("/accel", schema, {"x": 0.0, "y": 0.0, "z": a}, log_time=stamp, publish_time=stamp)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    found = run_json(capsys, "free-decay", str(bag), *BENCH, "--field", "acceleration_mps2=/accel:z")
    assert found["added_mass_kg"]["value"] == pytest.approx(0.8289, rel=0.005)
    assert command_line.main(["free-decay", str(bag), *BENCH]) == 2
    assert "--field" in capsys.readouterr().err
    assert command_line.main(["free-decay", str(bag), *BENCH, "--field", "acceleration_mps2=/accel:w"]) == 2
    assert "/accel: no number called 'w'; there is x, y, z" in capsys.readouterr().err


def test_forced_pendulum_and_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(3000) / 100.0
    files = []
    for frequency in (0.2, 0.4):
        z = 0.02 * np.sin(2.0 * np.pi * frequency * time)
        force = (-86.7 - 78.0) * -((2.0 * np.pi * frequency) ** 2) * z
        files.append(write_csv(tmp_path / f"{frequency}.csv", time_s=time, displacement_m=z, Z_N=force))
    words = ["--motion", "heave", "--mass", "78", "--length", "0.875", *plot(tmp_path, "forced")]
    found = run_json(capsys, "forced", *files, *words)
    assert found["coefficients"]["Z_wdot"]["fourier"]["value"] == pytest.approx(-86.7, rel=1e-3)

    clock = array(np.arange(0.0, 12.0, 0.02))
    file = write_csv(
        tmp_path / "p.csv", time_s=clock, theta_rad=pendulum.simulate(clock, np.array([-6.7, 0.4, 0.5]), 1.0)
    )
    words = ["--mass", "3.739", "--arm", "0.4", "--buoyancy-kgf", "2.24", *plot(tmp_path, "pendulum")]
    found = run_json(capsys, "pendulum", file, *words)
    assert found["output_error"]["gamma"]["value"] == pytest.approx(0.5, rel=1e-3)

    plant, ticks = step.StepPlant(27.3, 1.25, 66.48), array(np.arange(0.0, 8.0, 0.05))
    columns = [
        np.concatenate([part(t) for t in (5.0, 20.0)])
        for part in (lambda _: ticks, lambda t: plant.velocity_mps(ticks, t), lambda t: np.full(ticks.size, t))
    ]
    file = write_csv(tmp_path / "s.csv", time_s=columns[0], velocity_mps=columns[1], thrust_N=columns[2])
    found = run_json(capsys, "step", file, "--mass", "15.22", *plot(tmp_path, "step"))
    assert found["added_mass_kg"]["value"] == pytest.approx(12.08, rel=1e-3)
    assert {file.stem for file in tmp_path.glob("*.svg")} == {"forced", "pendulum", "step"}


def test_step_simulates_the_figures_of_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    found = run_json(capsys, "step", "--mass", "3.739", "--added-mass", "1.66", "--k-l", "61.89", "--k-q", "0.398")
    assert [row["thrust_N"] for row in found["steps"]] == [5, 10, 15, 20, 25, 30]
    speeds = [row["terminal_mps"] for row in found["steps"]]
    assert np.all(np.diff(speeds) > 0.0)
    assert all(abs(row["end_mps2"]) < 1e-6 for row in found["steps"])
    assert command_line.main(["step", "--mass", "3.7"]) == 2


def test_towing_and_bollard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_csv(tmp_path / "t.csv", speed_mps=array(np.arange(0.1, 1.01, 0.1)), drag_N=np.array(CFD))
    found = run_json(capsys, "towing", file, *plot(tmp_path, "towing"))
    assert (found["k_l"]["value"], found["k_q"]["value"]) == pytest.approx((62.0, 0.4))

    pulse = np.concatenate((np.arange(1100.0, 1470.0, 20.0), np.arange(1540.0, 1901.0, 20.0)))
    file = write_csv(tmp_path / "b.csv", pulse_us=pulse, load_N=(pulse - 1500.0) / 26.0)
    found = run_json(
        capsys, "bollard", file, "--lever-ratio", "2.0", "--supply", "14.8", *CELL, *plot(tmp_path, "bollard")
    )
    assert {file.stem for file in tmp_path.glob("*.svg")} == {"towing", "bollard"}
    assert yaml.safe_load(found["block"])["curves"]["main"]["positive"]["to_us"] == 1900.0


def test_estimate_from_dimensions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--length", "0.404", "--width", "0.108", "--height", "0.214", "--mass", "8", *plot(tmp_path, "estimate")]
    found = run_json(capsys, "estimate", *words, "--front", "0.023112", "--side", "0.086456", "--top", "0.031663")
    assert (tmp_path / "estimate.svg").is_file()
    assert found["quadratic_drag"][:3] == pytest.approx([12.459, 83.2442, 19.2536], rel=0.002)
    assert command_line.main(["estimate"]) == 2
    assert "--length, --width, --height, --mass not given" in capsys.readouterr().err


@pytest.mark.parametrize(
    "kind", ["gz", "stonefish", "stonefish-quadratic", "uuv", "fossen", "python", "vehicle", "csv", "latex", "urdf"]
)
def test_export_writes_every_format(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {name: {"value": 1.0, "std": 0.1} for name in ("k_q", "k_l", "b", "added_mass")}
    names = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    (tmp_path / "coefficients.yaml").write_text(yaml.safe_dump({"motions": dict.fromkeys(names, body)}))
    out = tmp_path / "out.text"
    assert command_line.main(["export", str(tmp_path), "--to", kind, "--out", str(out)]) == 0
    assert out.stat().st_size > 200
    assert command_line.main(["export", str(tmp_path), "--to", kind]) == 0
    assert capsys.readouterr().out == out.read_text()


def test_a_vehicle_file_alone_is_exported_as_what_nobody_has_identified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command_line.main(["export", "--vehicle", "lbv", "--to", "gz", "--out", str(tmp_path / "lbv.sdf")]) == 0
    written = " ".join((tmp_path / "lbv.sdf").read_text().split())
    assert "come from the vehicle file: nobody has identified them" in written
    bare = tmp_path / "bare.yaml"
    bare.write_text("{name: bare, mass_kg: 1.0, volume_m3: 0.001, envelope_m: [0.1, 0.1, 0.1]}")
    capsys.readouterr()
    assert command_line.main(["export", "--vehicle", str(bare), "--to", "gz"]) == 1
    assert "has no hydrodynamics, wanted some, or results of a run" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "files"),
    [
        ("gz", ["README.md", "bridge.yaml", "model.config", "model.sdf", "world.sdf"]),
        ("mujoco", ["README.md", "hydrodynamics.py", "mujoco_vehicle.py", "ros_vehicle.py", "vehicle.xml"]),
    ],
)
def test_a_name_without_an_ending_is_a_folder_that_can_be_driven(kind: str, files: list[str], tmp_path: Path) -> None:
    body = {name: {"value": 0.5, "std": 0.1} for name in ("k_q", "k_l", "b", "added_mass")}
    names = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    (tmp_path / "coefficients.yaml").write_text(yaml.safe_dump({"motions": dict.fromkeys(names, body)}))
    assert command_line.main(["export", str(tmp_path), "--to", kind, "--out", str(tmp_path / "mine")]) == 0
    assert sorted(file.name for file in (tmp_path / "mine").iterdir()) == files


def test_samples_are_a_table_and_a_model_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {name: {"value": 0.5, "std": 0.1} for name in ("k_q", "k_l", "b", "added_mass")}
    names = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    (tmp_path / "coefficients.yaml").write_text(yaml.safe_dump({"motions": dict.fromkeys(names, body)}))
    words = ["export", str(tmp_path), "--samples", "2", "--to"]
    assert command_line.main([*words, "mujoco", "--out", str(tmp_path / "m")]) == 0
    assert sorted(file.name for file in (tmp_path / "m").iterdir()) == ["1", "2", "samples.csv"]
    assert (tmp_path / "m/2/mujoco_vehicle.py").is_file()
    assert command_line.main([*words, "fossen", "--out", str(tmp_path / "f")]) == 0
    assert "sample 2 of 2" in (tmp_path / "f/2/model.yaml").read_text()
    assert len((tmp_path / "f/samples.csv").read_text().splitlines()) == 3
    assert command_line.main([*words, "latex", "--out", str(tmp_path / "l")]) == 2
    assert command_line.main([*words, "gz"]) == 2
    assert "wanted one for the table" in capsys.readouterr().err


def test_a_model_that_would_explode_is_not_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {name: {"value": 20.0, "std": 0.1} for name in ("k_q", "k_l", "b", "added_mass")}
    names = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    (tmp_path / "coefficients.yaml").write_text(yaml.safe_dump({"motions": dict.fromkeys(names, body)}))
    assert command_line.main(["export", str(tmp_path), "--to", "gz-plugin", "--out", str(tmp_path / "m.sdf")]) == 1
    assert "would explode" in capsys.readouterr().err
    assert not (tmp_path / "m.sdf").exists()
    assert command_line.main(["export", str(tmp_path), "--to", "mujoco"]) == 2
    assert "wanted a folder" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["csv", "latex"])
def test_a_table_of_one_motion_wants_no_other(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {name: {"value": 1.0, "std": 0.1} for name in ("k_q", "k_l", "b", "added_mass")}
    document = {"conditions": {"vehicle": "other"}, "motions": {"surge": body}}
    (tmp_path / "coefficients.yaml").write_text(yaml.safe_dump(document))
    assert command_line.main(["export", str(tmp_path), "--to", kind]) == 0
    captured = capsys.readouterr()
    assert "surge" in captured.out
    assert "sway" not in captured.out
    assert captured.err == ""
    assert command_line.main(["export", str(tmp_path), "--to", "gz"]) == 2


def test_the_results_of_another_vehicle_are_not_put_on_ours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {name: {"value": 1.0, "std": 0.1} for name in ("k_q", "k_l", "b", "added_mass")}
    names = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    file = tmp_path / "coefficients.yaml"
    file.write_text(yaml.safe_dump({"conditions": {"vehicle": "other"}, "motions": dict.fromkeys(names, body)}))
    for to in ("gz", "urdf"):
        assert command_line.main(["export", str(file), "--to", to]) == 2
        assert "the results are of other" in capsys.readouterr().err
    assert command_line.main(["export", str(file), "--to", "gz", "--vehicle", str(default_vehicle())]) == 0
    assert "note: the results are of other" in capsys.readouterr().err


def test_a_full_disk_leaves_the_export_that_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    words, file = ["export", "--vehicle", "lbv", "--to", "gz", "--out"], tmp_path / "lbv.sdf"
    assert command_line.main([*words, str(file)]) == 0
    before = file.read_text()
    monkeypatch.setattr(Path, "replace", full)
    assert command_line.main([*words, str(file)]) == 1
    assert "cannot be written (No space left on device)" in capsys.readouterr().err
    assert (file.read_text(), list(tmp_path.iterdir())) == (before, [file])


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["towing", "nothing.csv"], 2, "nothing.csv: cannot be read"),
        (["export", "nothing.yaml", "--to", "gz"], 2, "nothing.yaml: cannot be read"),
        (
            ["export", "--to", "gz"],
            2,
            "--to gz: found no results, wanted a coefficients.yaml, a run's folder, or --vehicle",
        ),
        (["towing", "{}/bad.csv"], 2, "line 3, column drag_N: found 'x'"),
        (["towing", "{}/good.csv", "--plot", "{}/a.bmp"], 2, "wanted one of .png"),
        (["towing", "{}/good.csv", "--plot", "{}/no/a.png"], 2, "cannot be written"),
    ],
)
def test_what_goes_wrong_is_one_sentence_and_an_exit_code(
    words: list[str], code: int, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.csv").write_text("speed_mps,drag_N\n0.1,1\n0.2,x\n")
    (tmp_path / "good.csv").write_text("speed_mps,drag_N\n0.1,1\n0.2,2.1\n0.3,3\n")
    assert command_line.main([word.replace("{}", str(tmp_path)) for word in words]) == code
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
