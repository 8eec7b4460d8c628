"""`identify` over third-party records: CSV, MCAP, sqlite3, any topics and frames; no confidence without cause."""

import functools
import json
import math
import re
import shutil
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import ardusub
import numpy as np
import pytest
from mcap_ros2.writer import Writer
from synthetic_runs import Flight, back_and_forth, fly
from ulog import ulog

from hindrax_analysis.coefficients_file import read_coefficients
from hindrax_analysis.records.third_party_bag import TopicSelection, read_bag, topics_of
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.read.recovery import recover
from hindrax_bringup.clone import clone_root
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.command_line import main
from hindrax_cli.commands.data import identify
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.topics import MANEUVER, resolved
from hindrax_core.vehicle import Drag, Vehicle, load_vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import Model

MASS_kg = 20.0
TRUTH = {"k_q": 66.48, "k_l": 1.25, "added_mass": 12.0}
SEPARATOR = "=" * 80
HEADER = f"{SEPARATOR}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
TIME_PART = f"{SEPARATOR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
VECTOR = f"{SEPARATOR}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
WRENCH_PART = f"{SEPARATOR}\nMSG: geometry_msgs/Wrench\nVector3 force\nVector3 torque\n"
TWIST_PART = f"{SEPARATOR}\nMSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n"
COVARIANCE_PART = f"{SEPARATOR}\nMSG: geometry_msgs/TwistWithCovariance\nTwist twist\nfloat64[36] covariance\n"
POSE_PART = (
    f"{SEPARATOR}\nMSG: geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n"
    f"{SEPARATOR}\nMSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n"
    f"{SEPARATOR}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    f"{SEPARATOR}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)
DEFINITIONS = {
    "geometry_msgs/msg/WrenchStamped": "std_msgs/Header header\nWrench wrench\n"
    + HEADER
    + TIME_PART
    + WRENCH_PART
    + VECTOR,
    "geometry_msgs/msg/Wrench": "Vector3 force\nVector3 torque\n" + VECTOR,
    "geometry_msgs/msg/TwistStamped": "std_msgs/Header header\nTwist twist\n"
    + HEADER
    + TIME_PART
    + TWIST_PART
    + VECTOR,
    "geometry_msgs/msg/TwistWithCovarianceStamped": "std_msgs/Header header\nTwistWithCovariance twist\n"
    + HEADER
    + TIME_PART
    + COVARIANCE_PART
    + TWIST_PART
    + VECTOR,
    "nav_msgs/msg/Odometry": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n"
    + HEADER
    + TIME_PART
    + POSE_PART
    + COVARIANCE_PART
    + TWIST_PART
    + VECTOR,
}
IDENTITY_POSE = {
    "pose": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}},
    "covariance": [0.0] * 36,
}
START_S = 1_700_000_000.0


@functools.cache
def flight(
    levels: tuple[float, ...] | tuple[float, float, float, float], end_s: float, span_s: float, k_q: float
) -> Flight:
    theta = np.array([k_q, TRUTH["k_l"], 0.0, MASS_kg + TRUTH["added_mass"]])
    return fly(Model(0, MASS_kg), theta, back_and_forth(levels, span_s, end_s), 0.0)


def flown(
    *,
    levels: tuple[float, ...] = (3.0, 6.0, 10.0, 14.0),
    noise: float = 0.01,
    gain: float = 1.0,
    current: float = 0.0,
    seed: int = 0,
    end_s: float = 80.0,
    span_s: float = 5.0,
    k_q: float = 66.48,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Times and velocities at 10 Hz, times and forces at 25 Hz, of a vehicle that the model describes."""
    true = flight(levels, end_s, span_s, k_q)
    rng = np.random.default_rng(seed)
    t, v = true.grid.times_s[::20], true.path.v[::20]
    return (t, v + current + noise * rng.standard_normal(len(v))), (true.times_s[::2], gain * true.commands[::2])


def as_csv(
    path: Path, velocities: tuple[Array, Array], forces: tuple[Array, Array], names: tuple[str, str] = ("u", "X")
) -> Path:
    rows = [(t, f"{v:.6f}", "") for t, v in zip(*velocities, strict=True)]
    rows += [(t, "", f"{f:.6f}") for t, f in zip(*forces, strict=True)]
    lines = [f"{t:.4f},{a},{b}" for t, a, b in sorted(rows, key=lambda row: row[0])]
    path.write_text("\n".join([f"t,{names[0]},{names[1]}", *lines]))
    return path


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """The smallest vehicle file there is."""
    file = tmp_path / "small.yaml"
    file.write_text(f"name: small\nmass_kg: {MASS_kg}\nvolume_m3: 0.0203\nenvelope_m: [0.6, 0.5, 0.4]\n")
    return file


def identified(capsys: pytest.CaptureFixture[str], *words: object) -> Any:
    assert main(["identify", *map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def refused(capsys: pytest.CaptureFixture[str], *words: Path | str | int) -> tuple[int, str]:
    code = main(["identify", *map(str, words)])
    said = capsys.readouterr().err.strip()
    assert said.startswith("hindrax identify: ")
    assert "\n" not in said
    return code, said


def is_true(surge: dict[str, Any], sigmas: float = 4.0) -> bool:
    return all(abs(surge[name]["value"] - TRUTH[name]) < sigmas * surge[name]["std"] for name in TRUTH)


def force_at(surge: dict[str, Any], speed: float) -> float:
    found: float = surge["k_q"]["value"] * speed**2 + surge["k_l"]["value"] * speed
    return found


# ---- CSV


def test_csv_gives_the_truth_with_the_smallest_vehicle_file(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = identified(capsys, as_csv(tmp_path / "a.csv", *flown()), "--vehicle", small)
    surge = document["motions"]["surge"]
    assert surge["identifiable"]
    assert is_true(surge)
    assert document["aborted"] is None
    assert document["report"] is None
    assert set(document["motions"]) == {"surge"}


def test_a_report_and_a_file_are_left_where_asked(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, file = tmp_path / "a.html", tmp_path / "a.yaml"
    words = [as_csv(tmp_path / "a.csv", *flown()), "--vehicle", small, "--report", page, "--coefficients", file]
    document = identified(capsys, *words)
    assert document["report"] == str(page)
    assert "Online estimate of k_q" in page.read_text()
    assert "small" in file.read_text()


def test_the_table_says_what_is_known_and_what_is_not(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = as_csv(tmp_path / "a.csv", *flown(levels=(0.3, 0.5), noise=0.003))
    assert main(["identify", str(record), "--vehicle", str(small)]) == 0
    said = capsys.readouterr().out
    assert "surge: not identifiable" in said
    assert re.search(r"drag: 0\.\d+ \+- 0\.\d+ N at 0\.\d+ m/s, 0\.\d+ \+- 0\.\d+ N at 0\.\d+ m/s", said)
    assert re.search(r"surge: thrust lags by 0\.\d\d s, velocities come 0\.\d\d s (late|early)", said)
    assert "COB-2023" not in said


def test_a_part_of_a_record_is_taken(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = as_csv(tmp_path / "a.csv", *flown())
    whole = identified(capsys, record, "--vehicle", small)["motions"]["surge"]
    part = identified(capsys, record, "--vehicle", small, "--from", 15, "--to", 65)["motions"]["surge"]
    assert part["samples"] < 0.8 * whole["samples"]
    assert is_true(part)


def test_a_dvl_without_lock_is_told_and_leaves_the_truth(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (t, v), forces = flown()
    for begin_s in (7.0, 22.0, 50.0):
        v = np.where((t > begin_s) & (t < begin_s + 4.0), 0.0, v)
    found = identified(capsys, as_csv(tmp_path / "lost.csv", (t, v), forces), "--vehicle", small)
    assert any("exactly 0 in motion" in one for one in found["assumptions"])
    assert found["motions"]["surge"]["identifiable"]
    assert is_true(found["motions"]["surge"])


def test_one_file_per_topic_is_one_record(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    velocities, forces = flown()
    files = []
    for name, header, (t, values) in (
        ("odometry", "field.twist.twist.linear.x", velocities),
        ("thrust", "field.wrench.force.x", forces),
    ):
        files.append(tmp_path / f"{name}.csv")
        rows = [f"{round(1e9 * (START_S + at))},{value:.6f}" for at, value in zip(t, values, strict=True)]
        files[-1].write_text("\n".join([f"%time,{header}", *rows]))
    apart = identified(capsys, *files, "--vehicle", small)
    together = identified(capsys, as_csv(tmp_path / "one.csv", velocities, forces), "--vehicle", small)
    assert apart["motions"]["surge"]["k_q"]["value"] == pytest.approx(
        together["motions"]["surge"]["k_q"]["value"], 1e-3
    )
    assert "runs" not in apart
    code, said = refused(capsys, files[0], files[0], "--vehicle", small)
    assert code == 2
    assert "holds velocities alone" in said
    assert refused(capsys, files[0], "--vehicle", small)[0] != 0


def test_coefficients_predict_a_record_that_they_were_not_fitted_to(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fitted, fresh = (
        as_csv(tmp_path / "fitted.csv", *flown()),
        as_csv(tmp_path / "fresh.csv", *flown(seed=3, noise=0.02)),
    )
    file, plot = tmp_path / "coefficients.yaml", tmp_path / "fresh.svg"
    identified(capsys, fitted, "--vehicle", small, "--coefficients", file)
    assert main(["predict", str(file), str(fresh), "--vehicle", str(small), "--plot", str(plot), "--json"]) == 0
    surge = json.loads(capsys.readouterr().out)["motions"]["surge"]
    assert surge["rmse"] == pytest.approx(0.02, rel=0.3)
    assert surge["rmse_stays_still"] > 0.2
    assert plot.read_text().startswith("<?xml")
    assert main(["predict", str(file), str(fresh)]) == 2
    assert "name one with --vehicle" in capsys.readouterr().err
    assert main(["predict", str(file), str(fresh), "--vehicle", str(small), "--dof", "yaw"]) == 1
    capsys.readouterr()
    assert main(["predict", str(file), str(fresh), "--vehicle", str(small), "--from", "5", "--to", "2"]) == 2
    assert "--to 2: wanted more than --from 5" in capsys.readouterr().err


def test_another_axis_has_its_units(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = as_csv(tmp_path / "a.csv", *flown(), names=("r", "N"))
    yaw = identified(capsys, record, "--vehicle", small)["motions"]["yaw"]
    assert yaw["k_q"]["unit"] == "N m s^2"


# ---- never sure without cause


@pytest.mark.parametrize(("excess_N", "told"), [(3.0, True), (0.0, False)])
def test_a_mass_that_cannot_be_is_told(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str], excess_N: float, told: bool
) -> None:
    velocities, (t, force) = flown()
    floats_N = load_vehicle(small).net_buoyancy_N + excess_N
    record = as_csv(tmp_path / "heave.csv", velocities, (t, force + floats_N), ("w", "Z"))
    heave = identified(capsys, record, "--vehicle", small)["motions"]["heave_down"]
    assert any("check mass_kg, volume_m3" in one for one in heave["warnings"]) == told


@pytest.mark.parametrize(
    "record",
    [
        {"levels": (0.05, 0.1), "noise": 0.03},
        {"levels": (0.15,), "noise": 0.02},
        {"levels": (3.0,), "end_s": 6.0},
        {"gain": -1.0},
        {"gain": 0.0},
        {"levels": (8.0,), "span_s": 1000.0},
    ],
    ids=["drowned in noise", "one slow speed", "too short", "wrong sign", "no thrust", "thrust never changes"],
)
def test_what_cannot_be_known_is_called_so(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str], record: dict[str, Any]
) -> None:
    surge = identified(capsys, as_csv(tmp_path / "a.csv", *flown(**record)), "--vehicle", small)["motions"]["surge"]
    assert not surge["identifiable"]
    assert surge["reasons"]


def test_the_wrong_sign_is_named(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    surge = identified(capsys, as_csv(tmp_path / "a.csv", *flown(gain=-1.0)), "--vehicle", small)["motions"]["surge"]
    assert any("sign" in reason for reason in surge["reasons"])


@pytest.mark.parametrize("current", [0.03, 0.1])
def test_a_current_is_seen_or_its_harm_lies_within_the_band(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str], current: float
) -> None:
    surge = identified(capsys, as_csv(tmp_path / "a.csv", *flown(current=current)), "--vehicle", small)["motions"][
        "surge"
    ]
    assert not surge["identifiable"] or is_true(surge)


def test_motion_that_has_nothing_to_do_with_the_thrust(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (t, _), forces = flown()
    wander = np.cumsum(np.random.default_rng(3).standard_normal(len(t))) * 0.02
    surge = identified(capsys, as_csv(tmp_path / "a.csv", (t, wander), forces), "--vehicle", small)["motions"]["surge"]
    assert not surge["identifiable"]


def test_a_slow_record_still_tells_the_drag_over_its_speeds(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = as_csv(tmp_path / "a.csv", *flown(levels=(0.3, 0.5), noise=0.003))
    surge = identified(capsys, record, "--vehicle", small)["motions"]["surge"]
    band = surge["drag_force"]
    truth = [TRUTH["k_q"] * u * u + TRUTH["k_l"] * u for u in band["speed"]]
    pairs = zip(band["force"], band["std"], truth, strict=True)
    assert all(abs(force - true) < 4.0 * std for force, std, true in pairs)


def test_pauses_part_the_record(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (t, v), forces = flown()
    keep = (t < 30.0) | (t > 40.0)
    surge = identified(capsys, as_csv(tmp_path / "a.csv", (t[keep], v[keep]), forces), "--vehicle", small)["motions"][
        "surge"
    ]
    assert surge["identifiable"]
    assert is_true(surge)


@pytest.mark.parametrize(("speed", "force"), [(1000.0, 1.0), (1.0, 0.01), (0.01, 1.0)])
def test_wrong_units_are_suspected(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str], speed: float, force: float
) -> None:
    (t, v), (t_w, w) = flown()
    record = as_csv(tmp_path / "a.csv", (t, speed * v), (t_w, force * w))
    surge = identified(capsys, record, "--vehicle", small)["motions"]["surge"]
    assert not surge["identifiable"]
    assert any("check the units" in reason for reason in surge["reasons"])


def test_the_gain_of_our_own_thrusters_may_be_doubted_too(capsys: pytest.CaptureFixture[str]) -> None:
    bag = clone_root() / "test" / "replay" / "bags" / "yaw_replug"
    believed, doubted = (
        identified(capsys, bag, *words)["motions"]["yaw"]["added_mass"] for words in ([], ["--gain-sigma", 0.3])
    )
    assert doubted["value"] == believed["value"]
    assert doubted["std_calibrated"] > 2.0 * believed["std_calibrated"]


@pytest.mark.parametrize(("words", "share"), [([], 0.1), (["--gain-sigma", 0.2], 0.2)])
def test_the_gain_of_a_wrench_is_never_taken_as_exact(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str], words: list[str], share: float
) -> None:
    record = as_csv(tmp_path / "a.csv", *flown(gain=1.15, end_s=60.0))
    document = identified(capsys, record, "--vehicle", small, *words)
    k_q = document["motions"]["surge"]["k_q"]
    budget = document["motions"]["surge"]["budget"]["k_q"]
    assert budget["gain of the wrench"] == pytest.approx(share * k_q["value"], rel=0.1)
    # The rest is what thrusters may lose: the record has no coasts that would tell.
    assert 0.95 < k_q["std_calibrated"] / math.hypot(k_q["std"], share * k_q["value"]) < 1.5
    assert any("--gain-sigma" in one for one in document["assumptions"])


def test_stamps_of_others_leave_the_added_mass_in_doubt(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (t, v), forces = flown()
    late = identified(capsys, as_csv(tmp_path / "a.csv", (t + 0.1, v), forces), "--vehicle", small)["motions"]["surge"]
    assert abs(late["added_mass"]["value"] - TRUTH["added_mass"]) < 3.0 * late["added_mass"]["std"]


# ---- several records


def test_several_records_are_pooled_and_their_spread_is_shown(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = [as_csv(tmp_path / f"{seed}.csv", *flown(seed=seed)) for seed in range(3)]
    assert main(["identify", *map(str, records), "--vehicle", str(small), "--json"]) == 0
    said = capsys.readouterr()
    assert "2.csv alone, 3 of 3" in said.err
    document = json.loads(said.out)
    pooled, runs = document["motions"]["surge"], [run["motions"]["surge"] for run in document["runs"]]
    assert is_true(pooled)
    assert len(runs) == 3
    assert pooled["samples"] > 2.5 * runs[0]["samples"]
    assert pooled["k_q"]["std"] < max(run["k_q"]["std"] for run in runs)
    assert document["spread"]["surge"]["k_q"]["runs"] == 3


def test_records_that_disagree_widen_the_band(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = [as_csv(tmp_path / "a.csv", *flown()), as_csv(tmp_path / "b.csv", *flown(k_q=90.0))]
    document = identified(capsys, *records, "--vehicle", small)
    pooled = document["motions"]["surge"]["k_q"]
    assert document["spread"]["surge"]["k_q"]["ratio"] > 3.0
    assert abs(pooled["value"] - 78.0) < 15.0
    assert pooled["std"] > 3.0 * document["runs"][0]["motions"]["surge"]["k_q"]["std"]


# ---- bags


def stamp_of(t_s: float) -> dict[str, int]:
    return {"sec": int(t_s), "nanosec": int((t_s % 1.0) * 1e9)}


def six(axis: int, value: float) -> tuple[dict[str, float], dict[str, float]]:
    flat = [value if i == axis else 0.0 for i in range(6)]
    names = ("x", "y", "z")
    return dict(zip(names, flat[:3], strict=True)), dict(zip(names, flat[3:], strict=True))


def velocity_message(
    kind: str, t_s: float, axis: int, value: float, frame: str, *, variance: float = 0.0
) -> dict[str, Any]:
    linear, angular = six(axis, value)
    twist = {"linear": linear, "angular": angular}
    header = {"stamp": stamp_of(t_s), "frame_id": frame}
    covariance = [variance if i % 7 == 0 else 0.0 for i in range(36)]
    if kind.endswith("Odometry"):
        inner = {"twist": twist, "covariance": covariance}
        return {"header": header | {"frame_id": "odom"}, "child_frame_id": frame, "pose": IDENTITY_POSE, "twist": inner}
    if kind.endswith("TwistStamped"):
        return {"header": header, "twist": twist}
    return {"header": header, "twist": {"twist": twist, "covariance": covariance}}


def wrench_message(kind: str, t_s: float, axis: int, value: float, frame: str) -> dict[str, Any]:
    force, torque = six(axis, value)
    wrench = {"force": force, "torque": torque}
    return (
        wrench
        if kind.endswith("/Wrench")
        else {"header": {"stamp": stamp_of(t_s), "frame_id": frame}, "wrench": wrench}
    )


ODOMETRY = ("nav_msgs/msg/Odometry", "/odom", "base_link")
THRUST = ("geometry_msgs/msg/WrenchStamped", "/thrust", "base_link")


def as_bag(
    path: Path,
    velocity: tuple[str, str, str] = ODOMETRY,
    wrench: tuple[str, str, str] = THRUST,
    *,
    axis: int = 0,
    signs: tuple[float, float] = (1.0, 1.0),
    extra: Sequence[Any] = (),
    variance: float = 0.0,
    end_s: float = 80.0,
) -> Path:
    (t_v, v), (t_w, w) = flown(end_s=end_s)
    rows = [(t, 0, value) for t, value in zip(t_v, v, strict=True)]
    rows += [(t, 1, value) for t, value in zip(t_w, w, strict=True)]
    with path.open("wb") as stream:
        writer = Writer(stream)
        kinds = {velocity[0], wrench[0], *(kind for kind, _ in extra)}
        schemas = {kind: writer.register_msgdef(kind, DEFINITIONS[kind]) for kind in kinds}
        for kind, topic in extra:
            content = velocity_message(kind, START_S, 0, 0.0, "base_link")
            first = int(START_S * 1e9)
            writer.write_message(topic, schemas[kind], content, log_time=first, publish_time=first)
        for t, which, value in sorted(rows):
            kind, topic, frame = (velocity, wrench)[which]
            at = START_S + float(t)
            signed = float(value) * signs[which]
            if which:
                content = wrench_message(kind, at, axis, signed, frame)
            else:
                content = velocity_message(kind, at, axis, signed, frame, variance=variance)
            received = int(at * 1e9)
            writer.write_message(topic, schemas[kind], content, log_time=received, publish_time=received)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    return path


@pytest.mark.parametrize(
    "velocity",
    ["nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/TwistWithCovarianceStamped"],
)
def test_every_type_of_velocity_serves(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str], velocity: str
) -> None:
    bag = as_bag(tmp_path / "a.mcap", (velocity, "/a/velocity", "rov/base_link"))
    document = identified(capsys, bag, "--vehicle", small, "--dof", "surge")
    assert document["motions"]["surge"]["identifiable"]
    assert is_true(document["motions"]["surge"])
    assert any("REP-103" in one for one in document["assumptions"])


def test_a_wrench_without_stamps_is_taken_by_its_times_of_receipt(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = as_bag(tmp_path / "a.mcap", wrench=("geometry_msgs/msg/Wrench", "/thrust", ""))
    document = identified(capsys, bag, "--vehicle", small)
    assert is_true(document["motions"]["surge"])
    assert any("receipt" in one for one in document["assumptions"])


@pytest.mark.parametrize(
    ("frame", "sign"), [("base_link", -1.0), ("base_link_fsd", 1.0), ("rov_frd", 1.0), ("body_ned", 1.0)]
)
def test_frames_are_turned_into_sname(tmp_path: Path, frame: str, sign: float) -> None:
    bag = as_bag(tmp_path / "a.mcap", ("nav_msgs/msg/Odometry", "/odom", frame), axis=1, end_s=10.0)
    found = read_bag(bag, TopicSelection(), topics_of(bag))
    (_, v), (_, w) = flown(end_s=10.0)
    assert found.velocity[:, 1] == pytest.approx(sign * v)
    assert found.wrench[:, 1] == pytest.approx(-w)


def test_mixed_frames_agree_after_turning(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fsd = ("geometry_msgs/msg/WrenchStamped", "/thrust", "base_link_fsd")
    bag = as_bag(tmp_path / "a.mcap", wrench=fsd, axis=1, signs=(-1.0, 1.0))
    sway = identified(capsys, bag, "--vehicle", small)["motions"]["sway"]
    assert is_true(sway)


def test_a_frame_can_be_told(tmp_path: Path, capsys: pytest.CaptureFixture[str], small: Path) -> None:
    world = ("geometry_msgs/msg/TwistStamped", "/velocity", "odom")
    bag = as_bag(tmp_path / "a.mcap", world)
    code, said = refused(capsys, bag, "--vehicle", small)
    assert code == 2
    assert "--frame" in said
    assert is_true(identified(capsys, bag, "--vehicle", small, "--frame", "flu")["motions"]["surge"])


@pytest.mark.parametrize(("variance", "known"), [(0.01, True), (-1.0, False), (1e6, False)])
def test_a_velocity_that_is_marked_unknown_is_not_used(tmp_path: Path, variance: float, known: bool) -> None:
    kind = "geometry_msgs/msg/TwistWithCovarianceStamped"
    bag = as_bag(tmp_path / "a.mcap", (kind, "/velocity", "base_link"), end_s=5.0, variance=variance)
    assert np.isfinite(read_bag(bag, TopicSelection(), topics_of(bag)).velocity).all() == known


def test_several_topics_are_ambiguous_until_one_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], small: Path
) -> None:
    bag = as_bag(tmp_path / "a.mcap", extra=[("geometry_msgs/msg/TwistStamped", "/cmd_vel")])
    code, said = refused(capsys, bag, "--vehicle", small)
    assert code == 2
    assert "/cmd_vel" in said
    assert "/odom" in said
    assert "--odometry" in said
    assert is_true(identified(capsys, bag, "--vehicle", small, "--odometry", "/odom")["motions"]["surge"])


@pytest.mark.parametrize(
    ("words", "wanted"),
    [(["--odometry", "/nothing"], "no such topic"), (["--wrench", "/odom"], "nav_msgs/msg/Odometry")],
)
def test_a_topic_that_does_not_serve_is_refused_with_what_is_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], wanted: str
) -> None:
    bag = as_bag(tmp_path / "a.mcap", end_s=5.0)
    code, said = refused(capsys, bag, *words)
    assert code == 2
    assert wanted in said
    assert "/thrust" in said


def test_a_bag_without_forces_lists_what_it_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("nav_msgs/msg/Odometry", DEFINITIONS["nav_msgs/msg/Odometry"])
        content = velocity_message("nav_msgs/msg/Odometry", START_S, 0, 0.1, "base_link")
        writer.write_message("/odom", schema, content, log_time=1, publish_time=1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    code, said = refused(capsys, path)
    assert code == 2
    assert "no topic holds the force" in said
    assert "/odom (nav_msgs/msg/Odometry)" in said


def test_sqlite_bags_open_too(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mcap = as_bag(tmp_path / "a.mcap")
    bag = tmp_path / "a.db3"
    with sqlite3.connect(bag) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute(
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT, "
            "encoded_message_definition TEXT)"
        )
        numbers: dict[str, int] = {}
        for message in messages(mcap):
            if message.topic not in numbers:
                numbers[message.topic] = len(numbers) + 1
                row = (numbers[message.topic], message.topic, message.type)
                base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr')", row)
                text = (row[0], message.type, DEFINITIONS[message.type])
                base.execute("INSERT INTO message_definitions VALUES(?, ?, 'ros2msg', ?)", text)
            received = (numbers[message.topic], message.received, message.data)
            base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", received)
    from_mcap = identified(capsys, mcap, "--vehicle", small)["motions"]["surge"]
    from_sqlite = identified(capsys, bag, "--vehicle", small)["motions"]["surge"]
    assert from_sqlite["k_q"]["value"] == pytest.approx(from_mcap["k_q"]["value"], rel=1e-9)


# ---- what is not there can be made


def bag_of(path: Path, topics: list[Any]) -> Path:
    """Bag of topics, each (name, type, definition, [(seconds, content)])."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        rows = []
        for name, kind, definition, told in topics:
            schema = writer.register_msgdef(kind, definition)
            rows += [(t, name, schema, content) for t, content in told]
        for t, name, schema, content in sorted(rows, key=lambda row: row[0]):
            at = int((START_S + t) * 1e9)
            writer.write_message(name, schema, content, log_time=at, publish_time=at)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    return path


def thrusts(forces: tuple[Array, Array]) -> tuple[str, str, str, list[tuple[Any, Any]]]:
    kind = "geometry_msgs/msg/WrenchStamped"
    told = [(t, wrench_message(kind, START_S + t, 0, float(f), "base_link")) for t, f in zip(*forces, strict=True)]
    return "/thrust", kind, DEFINITIONS[kind], told


RC_OUT = ("/mavros/rc/out", "mavros_msgs/msg/RCOut", f"std_msgs/Header header\nuint16[] channels\n{HEADER}{TIME_PART}")


def pulses_bag(path: Path, channels: list[int]) -> Path:
    """Velocities, and pulses in place of forces."""
    velocities, forces = flown(end_s=10.0)
    kind = "nav_msgs/msg/Odometry"
    moved = [
        (t, velocity_message(kind, START_S + t, 0, float(v), "base_link")) for t, v in zip(*velocities, strict=True)
    ]
    told = [(t, {"header": {"stamp": stamp_of(START_S + t), "frame_id": ""}, "channels": channels}) for t in forces[0]]
    return bag_of(path, [("/odom", kind, DEFINITIONS[kind], moved), (*RC_OUT, told)])


def test_pulses_become_forces_by_the_curves_of_the_vehicle_file(tmp_path: Path) -> None:
    bag = pulses_bag(tmp_path / "a.mcap", [1700, 1700, 0, 0, 1500, 1500, 1500, 1500])
    vehicle = load_vehicle(default_vehicle())
    found = read_bag(bag, TopicSelection(wrench="/mavros/rc/out"), topics_of(bag), vehicle)
    branch = vehicle.curves["main"].negative
    assert found.wrench[:, 0] == pytest.approx(-2.0 * math.cos(math.radians(55.0)) * branch.force_N(1300.0))
    assert found.wrench[:, 1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("channels", "words", "wanted"),
    [
        ([1700] * 8, [], "name it with --wrench"),
        ([1700] * 8, ["--wrench", "/mavros/rc/out"], "name a vehicle file with thrusters"),
        ([1700] * 6, ["--wrench", "/mavros/rc/out", "--vehicle", default_vehicle()], "holds 6 channels, wanted 8"),
        (
            [1] * 8,
            ["--wrench", "/mavros/rc/out", "--vehicle", default_vehicle()],
            "found a pulse of 1 us, wanted ",
        ),
    ],
)
def test_pulses_that_do_not_serve_are_refused_with_the_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], channels: list[int], words: list[str], wanted: str
) -> None:
    code, said = refused(capsys, pulses_bag(tmp_path / "a.mcap", channels), *words)
    assert code == 2
    assert wanted in said


def test_poses_alone_give_the_velocity(tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    true = flight((3.0, 6.0, 10.0, 14.0), 80.0, 5.0, 66.48)
    _, forces = flown()
    half = math.radians(30.0)
    rows = zip(true.grid.times_s[::4].tolist(), true.path.s[::4].tolist(), strict=True)
    told = [
        (t, {
            "header": {"stamp": stamp_of(START_S + t), "frame_id": "mocap"},
            "pose": {
                "position": {"x": s * math.cos(2.0 * half), "y": s * math.sin(2.0 * half), "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
            },
        })
        for t, s in rows
    ]  # fmt: skip
    kind = "geometry_msgs/msg/PoseStamped"
    definition = "std_msgs/Header header\ngeometry_msgs/Pose pose\n" + HEADER + TIME_PART + POSE_PART
    bag = bag_of(tmp_path / "a.mcap", [("/mocap/rov", kind, definition, told), thrusts(forces)])
    code, said = refused(capsys, bag, "--vehicle", small)
    assert code == 2
    assert "--odometry" in said
    surge = identified(capsys, bag, "--vehicle", small, "--odometry", "/mocap/rov")["motions"]["surge"]
    assert surge["identifiable"]
    assert force_at(surge, 0.4) == pytest.approx(force_at({k: {"value": v} for k, v in TRUTH.items()}, 0.4), rel=0.02)


def world_message(t: float, s: float, v: float) -> dict[str, Any]:
    """Odometry whose velocity is in the axes of the world, while its frames say that it is not."""
    east = {"x": 0.0, "y": float(v), "z": 0.0}
    still = {"x": 0.0, "y": 0.0, "z": 0.0}
    pose = {"position": {"x": 0.0, "y": float(s), "z": 0.0}}
    pose["orientation"] = {"x": 0.0, "y": 0.0, "z": math.sqrt(0.5), "w": math.sqrt(0.5)}
    zeros = [0.0] * 36
    twist = {"twist": {"linear": east, "angular": still}, "covariance": zeros}
    header = {"stamp": stamp_of(START_S + t), "frame_id": "odom"}
    return {
        "header": header,
        "child_frame_id": "base_link",
        "pose": {"pose": pose, "covariance": zeros},
        "twist": twist,
    }


def test_velocities_in_the_axes_of_the_world_are_found_out(
    tmp_path: Path, small: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    true = flight((3.0, 6.0, 10.0, 14.0), 80.0, 5.0, 66.48)
    (t, v), forces = flown()
    told = [(one, world_message(one, s, u)) for one, s, u in zip(t.tolist(), true.path.s[::20], v, strict=True)]
    kind = "nav_msgs/msg/Odometry"
    bag = bag_of(tmp_path / "a.mcap", [("/odom", kind, DEFINITIONS[kind], told), thrusts(forces)])
    document = identified(capsys, bag, "--vehicle", small)
    assert is_true(document["motions"]["surge"])
    assert any("axes of the world" in one for one in document["assumptions"])


# ---- logs of autopilots


def px4_log(vehicle: Vehicle, surge: Drag, mass_kg: float) -> Iterator[tuple[str, int, tuple[float, ...]]]:
    """Surge of a vehicle whose battery sags from 16.5 V to 13.5 V, heading north-east: 150 s of a log of PX4."""
    rng, v, step_s = np.random.default_rng(5), 0.0, 0.05
    for step in range(3000):
        at_us, volts = 50_000 * step, 16.5 - 0.001 * step
        pulses = ardusub.outputs("surge", (0.5, -0.5, 0.25, -0.25, -0.4, 0.4)[step // 80 % 6])
        applied = AppliedWrench(vehicle, volts)
        v += step_s * (applied.wrench(applied.forces_N(pulses))[0] - surge.k_q * abs(v) * v - surge.k_l * v) / mass_kg
        seen, late_us = math.sqrt(0.5) * (v + rng.normal(0.0, 0.01)), at_us + 50_000
        yield "vehicle_attitude", 0, (late_us, late_us, math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8))
        yield "vehicle_local_position", 0, (late_us, late_us, seen, seen, 0.0, True, True)
        yield "actuator_outputs", 0, (at_us, *pulses, *[0] * 8)
        yield "battery_status", 0, (at_us, volts)


def test_a_log_of_px4_is_identified_at_the_logged_voltage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vehicle, file = load_vehicle(ardusub.HEAVY), tmp_path / "dive.ulg"
    water = vehicle.hydrodynamics
    assert water is not None
    file.write_bytes(b"".join(ulog(px4_log(vehicle, water.surge, vehicle.mass_kg + water.added_mass[0]))))
    document = identified(capsys, file, "--vehicle", ardusub.HEAVY)
    assert list(document["motions"]) == ["surge"], "rounding in sway was taken for motion"
    surge = document["motions"]["surge"]
    assert surge["identifiable"]
    true = {"k_q": {"value": water.surge.k_q}, "k_l": {"value": water.surge.k_l}}
    assert force_at(surge, 0.5) == pytest.approx(force_at(true, 0.5), rel=0.03)
    assert any("13.5 to 16.5 V" in one for one in document["assumptions"])


# ---- wrong use


def test_a_record_that_does_not_exist(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(capsys, tmp_path / "none.mcap")
    assert code == 2
    assert "does not exist" in said


def test_a_span_beyond_the_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(capsys, as_csv(tmp_path / "a.csv", *flown(end_s=5.0)), "--from", 50)
    assert code == 2
    assert "the record lasts" in said


def test_an_aborted_run_says_so_whoever_tells_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = tmp_path / "run" / "bag"
    shutil.copytree(clone_root() / "test" / "replay" / "bags" / "surge", bag)
    assert main(["identify", str(tmp_path / "run")]) == 0
    assert "aborted" not in capsys.readouterr().err
    (tmp_path / "run" / "coefficients.yaml").write_text("aborted: 'operator: stopped by Ctrl-C'\nmotions: {}\n")
    assert main(["identify", str(tmp_path / "run"), "--coefficients", str(tmp_path / "again.yaml")]) == 0
    said = "aborted by operator: stopped by Ctrl-C; the results are of what was flown until then\n"
    assert said in capsys.readouterr().err
    assert read_coefficients(tmp_path / "again.yaml").conditions.aborted == "operator: stopped by Ctrl-C"
    assert identified(capsys, bag)["aborted"] == "operator: stopped by Ctrl-C"


def test_a_span_of_our_own_bag_in_which_nothing_was_flown(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(capsys, clone_root() / "test" / "replay" / "bags" / "pitch_reset", "--from", 900)
    assert code == 2
    assert "no motion was flown from 900 s" in said


def test_our_own_bag_without_a_maneuver_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flown = clone_root() / "test" / "replay" / "bags" / "surge"
    bag = recover(flown, tmp_path / "bag", keep=lambda topic, _: topic != resolved(MANEUVER)).output
    code, said = refused(capsys, bag)
    assert code == 2
    assert "is a bag of this stack, and no maneuver was flown in it" in said
    assert "--odometry /hindrax/navigation/odometry" in said


@pytest.mark.parametrize(("latency_s", "said"), [(0.07, "0.07 s late"), (-0.07, "0.07 s early")])
def test_velocities_come_late_or_early(latency_s: float, said: str) -> None:
    assert identify._delays(0.01, latency_s) == f"thrust lags by 0.01 s, velocities come {said}"


def test_a_span_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(capsys, as_csv(tmp_path / "a.csv", *flown(end_s=5.0)), "--from", 5, "--to", 2)
    assert code == 2
    assert "--to" in said


def test_without_a_vehicle_file_the_assumption_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = identified(capsys, as_csv(tmp_path / "a.csv", *flown()))
    assert any("--vehicle" in one for one in document["assumptions"])
    assert "added_mass" not in document["motions"]["surge"]
    assert math.isclose(document["motions"]["surge"]["k_q"]["value"], TRUTH["k_q"], rel_tol=0.05)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["identify", "RECORD", "--report", "none/a.html"], 1),
        (["identify", "RECORD", "--coefficients", "none/a.yaml"], 1),
        (["predict", "RECORD", "RECORD", "--plot", "none/a.png"], 2),
        (["bag", "plot", "RECORD", "/a:b", "--out", "none/a.png"], 1),
    ],
)
def test_a_place_that_cannot_be_written_is_told_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: int
) -> None:
    place = {"RECORD": "no-record", words[-1]: str(tmp_path / words[-1])}
    assert main([place.get(word, word) for word in words]) == code
    said = capsys.readouterr().err
    assert f"{words[-1]}: cannot be written (No such file or directory)" in said
    assert "no-record" not in said
