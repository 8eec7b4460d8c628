"""`hindrax vehicle`: ten answers make a file that can be flown; files are found by name, checked and shown."""

import io
import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hindrax_bringup.share_files import VEHICLE, default_vehicle, usual_vehicle, vehicle_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.machine import vehicle
from hindrax_cli.vehicle_plausibility import SENTENCES, Implausible
from hindrax_cli.vehicle_questions import BACK, QUESTIONS, ask, file_text
from hindrax_cli.vehicle_review import DOWN, UP, findings, picture, same_positions
from hindrax_control.allocation.allocator import Allocator
from hindrax_control.maneuver.goal import largest_wrench
from hindrax_core.errors import UsageError
from hindrax_core.knobs import build
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle, vehicle_from_text
from hindrax_ident.model.empirical_model import Dimensions, empirical

MUST = {"mass": "11.5", "size": "0.457, 0.338 0.254"}


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.delenv(VEHICLE, raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "hindrax"


def answer(monkeypatch: pytest.MonkeyPatch, **answers: str) -> int:
    lines = "".join(f"{(MUST | answers).get(one.key, '')}\n" for one in QUESTIONS)
    monkeypatch.setattr("sys.stdin", io.StringIO(lines))
    return main(["vehicle", "new", "myrov"])


def changed(**keys: object) -> Vehicle:
    return build(Vehicle, yaml.safe_load(default_vehicle().read_text()) | keys, "test:")


def test_only_a_cubic_without_its_other_direction_is_said_to_be_mirrored() -> None:
    def mirrored(rov: Vehicle) -> list[str]:
        return [one.found for one in findings(rov) if one.name.startswith("curve ")]

    tables = load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml")
    assert tables.curves["main"].positive is None
    assert mirrored(tables) == []
    cubic = load_vehicle(default_vehicle())
    assert mirrored(cubic) == ["positive branch assumed to mirror the negative one"]


@pytest.mark.parametrize(("layout", "flown"), [("6", 5), ("8", 6)])
def test_ten_answers_make_a_vehicle_that_passes_its_check_and_is_found_by_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], home: Path, layout: str, flown: int
) -> None:
    assert answer(monkeypatch, layout=layout, buoyancy="2") == 0
    assert len(QUESTIONS) == 10
    vehicle = load_vehicle(home / "myrov.yaml")
    assert vehicle.net_buoyancy_N == pytest.approx(2.0, abs=0.01)
    assert vehicle.hydrodynamics is not None
    assert all(one.ok for one in findings(vehicle))
    capsys.readouterr()
    assert main(["vehicle", "check", "myrov", "--json"]) == 0
    checks = {one["name"]: one["found"] for one in json.loads(capsys.readouterr().out)["checks"]}
    assert len(checks["flies"].split(", ")) == flown
    assert main(["allocate", "--vehicle", "myrov", "--wrench", "5", "0", "0", "0", "0", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["achieved"][0] == pytest.approx(5.0, abs=0.1)
    assert answer(monkeypatch) == 2, "a file is never written over"


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"mass": ""}, "found nothing, wanted 1 number from 0.1 to 100000"),
        ({"size": "1 2"}, "found '1 2', wanted 3 numbers"),
        ({"mass": "11,5"}, "found '11,5', wanted 1 number from 0.1 to 100000, with decimal points"),
        ({"layout": "7"}, "wanted one of 0, 6, 8"),
        ({"thrust": "nan"}, "found 'nan'"),
        ({"buoyancy": "-9000"}, "-9000 N for a weight of 113 N: wanted at most 50% of it"),
        ({"buoyancy": "200"}, "likely it is in grams of force: 1.961"),
        ({"mass": "11500"}, "11.5 m^3 displaced, and a box of 39.2 litres: more than it holds; likely the mass is in"),
        ({"mass": "11500"}, "in grams: 11.5"),
        ({"size": "2.57 3.38 2500"}, "wanted 3 numbers from 0.01 to 3.5"),
        ({"size": "45.7 33.8 25.4"}, "likely it is in centimeters: 0.457 0.338 0.254"),
        ({"size": "457 338 254"}, "wanted 3 numbers from 0.01 to 3.5; likely it is in millimeters: 0.457 0.338 0.254"),
        ({"angle": "0.785"}, "wanted 1 number from 1 to 89; likely it is in radians: 44.98"),
        ({"vectored": "31 22"}, "far outside of an envelope of 0.457 x 0.338 x 0.254 m; likely it is in centimeters"),
        ({"thrust": "3000"}, "wanted 1.1 to 564 N; likely it is in grams of force: 29.42"),
        ({"dvl": "0 0 13"}, "likely it is in centimeters: 0 0 0.13"),
        ({"pool": "5000 6 2"}, "wanted 3 numbers from 1 to 1000, 0.5 to 6000"),
        ({"pool": "10 6 0.2"}, "wanted 3 numbers"),
        ({"size": "1.8 1.2 0.9", "mass": "300", "pool": "1.5 6 2"}, "too small for a vehicle of 1.8 x 1.2 x 0.9 m"),
    ],
)
def test_an_answer_that_makes_no_sense_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], home: Path, given: dict[str, str], wanted: str
) -> None:
    assert answer(monkeypatch, **given) == 2
    said = capsys.readouterr().err
    assert wanted in said
    assert "_" not in said.partition("hindrax vehicle: ")[2].replace("myrov", ""), "no key of the file: none was typed"
    assert not (home / "myrov.yaml").exists()


def test_answers_of_a_start_that_failed_stand_in_brackets_at_the_next(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], home: Path
) -> None:
    assert answer(monkeypatch, mass="12.5", layout="8", thrust="40", pool="0 0 0") == 2
    assert f"kept in {home / 'myrov.answers'}" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", io.StringIO("\n" * 10))
    assert main(["vehicle", "new", "myrov"]) == 0
    assert "1. mass in kg, dry, trimmed as it flies [12.5]:" in capsys.readouterr().err
    made = load_vehicle(home / "myrov.yaml")
    assert (made.mass_kg, len(made.thrusters)) == (12.5, 8)
    assert made.curves["main"].negative.force_N(1100.0) == pytest.approx(-40.0, abs=0.01)
    assert not (home / "myrov.answers").exists(), "it has made its file"


@pytest.mark.parametrize("damage", ["", "[1, 2]", "{}", '{"mass": "x"}', '{"mass": [null]}', "\x00"])
def test_a_damaged_file_of_answers_is_none(monkeypatch: pytest.MonkeyPatch, home: Path, damage: str) -> None:
    home.mkdir()
    (home / "myrov.answers").write_text(damage)
    assert answer(monkeypatch) == 0


def test_a_person_is_asked_both_answers_that_disagree_and_can_go_back() -> None:
    lines = ["11500", "", "0.457 0.338 0.254", "11.5", "", "8", BACK, "6", *[""] * 10]
    prompts: list[str] = []
    wrong: list[UsageError] = []

    def line_of(prompt: str) -> str:
        prompts.append(prompt.partition(".")[0] + prompt[prompt.rfind("[") :])
        return lines[len(prompts) - 1] + "\n"

    answers = ask(line_of, wrong.append)
    assert [error.args[0].code for error in wrong] == [Implausible.OVERFULL]
    shown = ["1[11500]:", "3[0.457 0.338 0.254]:", "4[6]:", "5[45]:", "4[8]:", "5[45]:"]
    assert prompts[3:9] == shown
    assert (answers["mass"], answers["layout"]) == ((11.5,), (6.0,))


def test_an_answer_out_of_its_own_bounds_is_asked_again_alone() -> None:
    lines = ["11.5", "", "45.7 33.8 25.4", "0.457 0.338 0.254", *[""] * 10]
    numbers: list[str] = []

    def line_of(prompt: str) -> str:
        numbers.append(prompt.partition(".")[0])
        return lines[len(numbers) - 1] + "\n"

    ask(line_of, lambda _: None)
    assert numbers[:5] == ["1", "2", "3", "3", "4"]


BOUNDED = st.fixed_dictionaries(
    {one.key: st.tuples(*(st.floats(low, high) for low, high in one.bounds)) for one in QUESTIONS}
)


@given(BOUNDED, st.sampled_from([0.0, 6.0, 8.0]), st.floats(0.05, 1.0), st.floats(-0.3, 0.3))
@settings(max_examples=60, deadline=None)
def test_answers_that_agree_make_a_valid_file(
    drawn: dict[str, tuple[float, ...]], layout: float, filled: float, pull: float
) -> None:
    """No answer that was accepted fails at the end, by the name of a key that nobody typed."""
    mass_kg = 1e3 * filled * math.prod(drawn["size"]) / (1.0 + pull)
    assume(0.1 <= mass_kg <= 1e5)
    drawn |= {"layout": (layout,), "mass": (mass_kg,), "buoyancy": (pull * mass_kg * 9.80665,)}
    accepted: dict[str, tuple[float, ...]] = {}
    for one in QUESTIONS:
        drawn_or_usual = drawn[one.key]
        if one.wrong("", drawn_or_usual, accepted):
            drawn_or_usual = one.suggestion(accepted, {})
        assume(drawn_or_usual)
        accepted[one.key] = drawn_or_usual
    vehicle_from_text(file_text("drawn", accepted), "drawn")


def test_an_input_that_ends_is_no_consent_to_what_is_in_brackets(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], home: Path
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("11.5\n\n0.4 0.3 0.2\n"))
    assert main(["vehicle", "new", "myrov"]) == 2
    assert "4. thrusters" in capsys.readouterr().err
    assert not (home / "myrov.yaml").exists()


def test_a_bracket_in_a_question_is_an_answer() -> None:
    answers = {"mass": (200.0,), "buoyancy": (1.0,), "size": (1.0, 1.0, 1.0), "layout": (6.0,)}
    for one in QUESTIONS:
        assert ("[" in one.prompt(answers, {})) == (one.key not in MUST), one.text


def test_nobody_answers_ten_questions_for_a_file_that_cannot_be_written(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(vehicle, "ask", lambda *_: pytest.fail("it asked first"))
    (tmp_path / "file").write_text("")
    assert main(["vehicle", "new", "myrov", "--out", str(tmp_path / "file" / "deeper" / "myrov.yaml")]) == 2
    assert "cannot be written (Not a directory)" in capsys.readouterr().err


def test_a_person_who_mistypes_is_asked_again_and_keeps_what_was_answered() -> None:
    asked: list[str] = []
    wrong: list[str] = []
    lines = iter(["heavy\n", "11.5\n", *["\n"] * 20])

    def line_of(prompt: str) -> str:
        asked.append(prompt)
        return next(lines) if len(asked) < 4 else ""

    with pytest.raises(UsageError, match="found nothing"):  # the end of the input
        ask(line_of, lambda error: wrong.append(str(error)))
    assert asked[0] == asked[1] != asked[2]
    assert "found 'heavy'" in wrong[0]


def test_each_reason_to_ask_again_has_a_code() -> None:
    assert set(SENTENCES) == set(Implausible)
    by_key = {one.key: one for one in QUESTIONS}
    earlier: dict[str, tuple[float, ...]] = {"mass": (11.5,), "buoyancy": (1.0,), "size": (0.457, 0.338, 0.254)}
    given = {
        "mass": (()), "layout": (7.0,), "size": (0.4, 0.3, 0.01), "buoyancy": (-9000.0,), "thrust": (3000.0,),
        "dvl": (0.0, 0.0, 13.0), "pool": (1.0, 1.0, 0.5), "vectored": (31.0, 22.0), "angle": (45.0,),
    }  # fmt: skip
    found = {key: by_key[key].wrong("", numbers, earlier).code for key, numbers in given.items()}
    assert found == {
        "mass": Implausible.NUMBERS, "layout": Implausible.LAYOUT, "size": Implausible.SLIM,
        "buoyancy": Implausible.PULL, "thrust": Implausible.THRUST, "dvl": Implausible.OUTSIDE,
        "pool": Implausible.NONE, "vectored": Implausible.OUTSIDE, "angle": Implausible.NONE,
    }  # fmt: skip


def test_a_vehicle_without_thrusters_is_enough_for_identification(monkeypatch: pytest.MonkeyPatch, home: Path) -> None:
    assert answer(monkeypatch, layout="0") == 0
    assert load_vehicle(home / "myrov.yaml").thrusters == ()
    assert main(["vehicle", "check", "myrov"]) == 1
    assert main(["vehicle", "show", "myrov"]) == 0


@pytest.mark.parametrize("word", ["check", "show"])
def test_check_and_show_say_which_file_they_read(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], home: Path, word: str
) -> None:
    assert answer(monkeypatch) == 0
    capsys.readouterr()
    main(["vehicle", word, "myrov"])
    assert f"myrov\n  {home / 'myrov.yaml'}\n" in capsys.readouterr().out
    Path("myrov.yaml").write_text("{name: small, mass_kg: 1.0, volume_m3: 0.001, envelope_m: [0.1, 0.1, 0.1]}")
    main(["vehicle", word, "myrov"])
    assert "small\n  myrov.yaml\n" in capsys.readouterr().out


def test_a_name_is_looked_for_here_then_among_ones_own_then_in_the_clone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, home: Path
) -> None:
    assert vehicle_file("hindrax") == default_vehicle()
    assert usual_vehicle() == str(default_vehicle())
    home.mkdir()
    (home / "hindrax.yaml").touch()
    assert vehicle_file("hindrax") == home / "hindrax.yaml"
    (tmp_path / "hindrax.yaml").touch()
    assert vehicle_file("hindrax").resolve() == tmp_path / "hindrax.yaml"
    assert vehicle_file("elsewhere/my.yaml") == Path("elsewhere/my.yaml")
    with pytest.raises(
        UsageError,
        match=r"vehicle nobody: found no nobody.yaml here, .* wanted one of bluerov2, bluerov2-heavy, hindrax, lbv",
    ):
        vehicle_file("nobody")
    monkeypatch.setenv(VEHICLE, "nobody")
    assert main(["allocate", "--wrench", *"100000"]) == 2
    with pytest.raises(SystemExit, match="2"):
        main(["allocate", "--wrench", *"100000", "--vehicle", ""])


@pytest.mark.parametrize(("usual", "name"), [("", "hindrax"), ("lbv", "lbv")])
def test_without_a_name_the_usual_vehicle_is_checked_and_shown(
    usual: str, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VEHICLE, usual)
    main(["vehicle", "check"])
    assert capsys.readouterr().out.split()[0] == name
    assert main(["vehicle", "show", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["vehicle"] == name


def test_what_looks_wrong_is_named_with_a_remedy() -> None:
    data = yaml.safe_load(default_vehicle().read_text())
    thrusters = [one | {"channel": 0} for one in data["thrusters"]]
    thrusters[0]["position_m"] = [2.95, -2.35, 1.0]
    body = {"volume_m3": 0.02, "center_of_buoyancy_m": [0.0, 0.0, 0.02], "hydrodynamics": None}
    wrong = changed(thrusters=thrusters, sensors={}, **body)
    remedies = {one.name for one in findings(wrong) if not one.ok}
    assert remedies >= {"net buoyancy", "righting arm", "channels", "thruster positions", "velocity", "hydrodynamics"}


@pytest.mark.parametrize(
    ("keys", "name", "remedy"),
    [
        (
            {"mass_kg": 11500.0, "volume_m3": 11.5},
            "hull",
            "correct mass_kg and volume_m3, likely in grams: 11.5 0.0115",
        ),
        ({"mass_kg": 15220.0}, "hull", "correct mass_kg, likely in grams: 15.22"),
        ({"volume_m3": 15.3}, "hull", "correct volume_m3, likely in litres: 0.0153"),
        ({"envelope_m": [5.9, 4.7, 4.0]}, "hull", "correct mass_kg, volume_m3 or envelope_m"),
        ({"envelope_m": [50.0, 47.0, 40.0]}, "hull", "correct envelope_m, likely in centimeters: 0.5 0.47 0.4"),
        ({"mass_kg": 1522.0, "volume_m3": 1.53, "envelope_m": [5.9, 4.7, 4.0]}, "thrust", "check the unit of curves"),
        (
            {"sensors": {"dvl75": {"device": "dvl75", "position_m": [0.0, 0.0, 15.0]}}},
            "sensor positions",
            "check unit and origin of position_m",
        ),
    ],
)
def test_numbers_that_do_not_fit_each_other_fail_the_check(
    keys: dict[str, object], name: str, remedy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("odd.yaml").write_text(yaml.safe_dump(yaml.safe_load(default_vehicle().read_text()) | keys))
    assert main(["vehicle", "check", "odd.yaml", "--json"]) == 1
    checks = {one["name"]: one["remedy"] for one in json.loads(capsys.readouterr().out)["checks"]}
    assert checks[name].startswith(remedy)


@pytest.mark.parametrize(
    ("inertia", "remedy"),
    [
        ((160.0, 160.0, 165.0), "likely g m^2: 0.16 0.16 0.165"),
        ((1600.0, 1600.0, 1650.0), "likely kg cm^2: 0.16 0.16 0.165"),
        ((0.4, 0.1, 0.16), "check inertia_kgm2; of a homogeneous box: 0.17 0.26 0.31"),
    ],
)
def test_moments_of_inertia_that_no_body_has_fail_the_check(inertia: tuple[float, ...], remedy: str) -> None:
    (found,) = (
        one.remedy
        for one in findings(changed(mass_kg=11.5, envelope_m=(0.457, 0.338, 0.254), inertia_kgm2=inertia))
        if one.name == "inertia"
    )
    assert remedy in found


@pytest.mark.parametrize(
    ("azimuths", "rotation", "named"),
    [
        ((0.7854, -0.7854, 2.3562, -2.3562), 0.0, ["azimuth_deg"]),
        ((0.96, -0.96, 2.18, -2.18), 0.0, ["azimuth_deg"]),
        ((0.0, 0.0, 2.0, -2.5), 1.53, []),
        ((55.0, -55.0, 125.0, -125.25), 90.0, []),
        ((45.0, -45.0, 135.0, -135.0), -1.5708, ["rotation of dvl75"]),
        ((45.0, -45.0, 135.0, -135.0), 3.14, ["rotation of dvl75"]),
    ],
    ids=["45 deg", "55 deg", "toed in", "degrees", "a quarter turn", "half a turn"],
)
def test_angles_in_radians_are_named(azimuths: tuple[float, ...], rotation: float, named: list[str]) -> None:
    data = yaml.safe_load(default_vehicle().read_text())
    for one, azimuth in zip(data["thrusters"], azimuths, strict=False):
        one["azimuth_deg"] = azimuth
    data["sensors"]["dvl75"]["rotation_deg"] = [0.0, 0.0, rotation]
    odd = changed(thrusters=data["thrusters"], sensors=data["sensors"])
    assert [one.name for one in findings(odd) if "likely radians" in one.remedy] == named


def test_a_negative_moment_of_inertia_is_refused_and_a_center_far_outside_is_named() -> None:
    with pytest.raises(UsageError, match=r"inertia_kgm2\[0\]: found -0\.1, wanted"):
        vehicle_from_text(
            "name: x\nmass_kg: 9\nvolume_m3: 0.01\nenvelope_m: [1, 1, 1]\ninertia_kgm2: [-0.1, 1, 1]", "x"
        )
    remedies = [one.remedy for one in findings(changed(center_of_buoyancy_m=(0.0, 0.0, -1.0)))]
    assert "outside of the envelope: check unit and origin of center_of_buoyancy_m" in remedies


def test_a_limit_below_what_the_thrusters_reach_is_reported() -> None:
    """Its own 60 N in surge are more than it reaches, and a limit on the reach takes nothing."""
    reach = largest_wrench(load_vehicle(default_vehicle()))
    tight = {"wrench": [20.0, reach["sway"], 80.0, 20.0, 25.0, 7.5]}
    for limits, reported in ((tight, ["leaves surge 20 of 36 N, yaw 7.5 of 23 N m"]), ({}, [])):
        checks = findings(changed(limits=limits))
        assert [one.found for one in checks if one.name == "limits.wrench"] == reported
        assert all(one.ok for one in checks)


def test_the_largest_wrench_of_an_axis_is_what_the_allocator_gives() -> None:
    vehicle = load_vehicle(default_vehicle())
    for axis, most in enumerate(largest_wrench(vehicle).values()):
        wrench = [0.0] * 6
        wrench[axis] = 0.99 * most
        found = Allocator(vehicle).allocate((wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]))
        assert found.achieved == pytest.approx(wrench, abs=0.02 * most), AXES[axis]


def test_every_thruster_is_in_the_picture_with_its_arrow() -> None:
    vehicle = load_vehicle(default_vehicle())
    shown = picture(vehicle)
    assert max(map(len, shown.splitlines())) <= 60
    lines = shown.splitlines()
    front = next(line for line in lines if "T1" in line)
    rear = next(line for line in lines if "T3" in line)
    assert front.index("T1\u2197") < front.index("T2\u2196"), "port is left, and both push forward and inwards"
    assert lines.index(front) < lines.index(rear), "the bow is up"
    assert all(f"T{number}{UP}" in shown for number in (5, 6, 7, 8))
    downward = changed(thrusters=[{"name": "A", "position_m": [0, 0, 0], "elevation_deg": -90.0}])
    assert f"A{DOWN}" in picture(downward)


@pytest.mark.parametrize("count", [2, 4, 9, 10])
def test_a_picture_of_thrusters_on_one_spot_ends(count: int) -> None:
    spot = [{"name": f"T{number}", "position_m": [0, 0, 0]} for number in range(count)]
    shown = picture(changed(thrusters=spot))
    assert sum(f"T{number}\u2191" in shown for number in range(count)) == min(count, 9)


def test_placeholder_positions_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    file = str(Path(__file__).with_name("same_spot.yaml"))
    assert main(["vehicle", "show", file]) == 0
    sentence = "A, B, C, D are all at (0, 0, 0) m"
    assert f"position_m: {sentence}; measure each" in capsys.readouterr().out
    assert main(["vehicle", "check", file, "--json"]) == 1
    checks = {one["name"]: one for one in json.loads(capsys.readouterr().out)["checks"]}
    assert (checks["one position"]["ok"], checks["one position"]["found"]) == (False, sentence)
    for name in ("hindrax", "bluerov2", "bluerov2-heavy", "lbv"):
        assert not same_positions(load_vehicle(vehicle_file(name)))


def test_the_estimate_prints_the_block_to_paste(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "--vehicle", "hindrax"]) == 0
    block = capsys.readouterr().out.partition("for the vehicle file")[2].partition("\n")[2]
    pasted = changed(**yaml.safe_load(block)).hydrodynamics
    data = load_vehicle(default_vehicle())
    model = empirical(Dimensions(*data.envelope_m, data.mass_kg, buoyancy_arm_m=0.02))
    assert pasted is not None
    assert pasted.added_mass == pytest.approx(model.added_mass, rel=0.01)
    assert [pasted.drag(axis).k_l for axis in AXES] == pytest.approx(model.linear_drag, rel=0.01)


def test_each_sensor_is_listed_with_what_its_mount_makes_of_it() -> None:
    vehicle = load_vehicle(default_vehicle())
    down = vehicle.sensors["ping1d"]
    ahead = replace(down, port="/dev/hindrax/ahead", rotation_deg=(0.0, 90.0, 0.0))
    found = {one.name: one.found for one in findings(replace(vehicle, sensors={**vehicle.sensors, "bow": ahead}))}
    assert found["ping1d"] == f"altitude; {down.port}"
    assert found["bow"] == "range ahead; /dev/hindrax/ahead"
