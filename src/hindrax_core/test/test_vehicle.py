"""The vehicle file: figures of the papers, and every mistake named by its key path."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.errors import UsageError
from hindrax_core.hydrostatics import Water
from hindrax_core.knobs import build
from hindrax_core.vehicle import Mount, Vehicle, capabilities, load_vehicle

FILE = Path(__file__).resolve().parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml"


def data() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(FILE.read_text())
    return found


def test_net_buoyancy_of_cob_2023_1394() -> None:
    # W - rho V g with the figures of section 2 gives 0.7845 N of buoyancy.
    assert load_vehicle(FILE).net_buoyancy_N == pytest.approx(0.7845, abs=5e-5)


def test_characteristic_length_of_cob_2023_1394() -> None:
    assert load_vehicle(FILE).characteristic_length_m == pytest.approx(0.2483, abs=5e-5)


def test_prism_inertia_of_eidsvik_2015() -> None:
    # Equation 3.1: m/12 (W^2 + H^2), m/12 (L^2 + H^2), m/12 (W^2 + L^2).
    m, L, W, H = 15.22, 0.59, 0.47, 0.40
    wanted = (m / 12 * (W**2 + H**2), m / 12 * (L**2 + H**2), m / 12 * (W**2 + L**2))
    assert load_vehicle(FILE).inertia == pytest.approx(wanted)


def test_thruster_1_points_as_in_cob_2023_1394() -> None:
    vehicle = load_vehicle(FILE)
    angle = math.radians(55.0)
    assert vehicle.thrusters[0].direction == pytest.approx((math.cos(angle), math.sin(angle), 0.0))
    assert all(one.direction == (0.0, 0.0, -1.0) for one in vehicle.thrusters[4:])


def test_negative_thruster_curve_of_cob_2023_1394_table_2() -> None:
    branch = load_vehicle(FILE).curves["main"].negative
    assert branch.force_N(1100.0) == pytest.approx(-15.5, abs=0.05)
    assert branch.force_N(1300.0) == pytest.approx(-8.15, abs=0.01)


@pytest.mark.parametrize(
    ("path", "value", "sentence"),
    [
        (("mass_kg",), -1.0, "here: mass_kg: found -1, wanted 0.1 to"),
        (
            ("thrusters", 2, "curve"),
            "other",
            r"here: thrusters\[2\].curve: found 'other', wanted one of curves \(main\)",
        ),
        (("thrusters", 3, "name"), "T1", "name T1 is used 2 times, wanted once"),
        (("thrusters", 0, "position_m"), [1.0], r"here: thrusters\[0\].position_m: found 1 values, wanted 3"),
        (
            ("output", "device"),
            "arduino",
            "output.device: found 'arduino', wanted one of pca9685, stm32, ardusub",
        ),
        (("output", "enable_line"), "26", "here: output: enable_line: found '26', wanted CHIP:LINE"),
        (("output", "enable_line"), "chip:x", "enable_line: found 'chip:x', wanted CHIP:LINE"),
        (("wings",), 2, "here: wings: unknown key"),
        (
            # COB-2023-1394 Table 2, positive row as printed.
            ("curves", "main", "positive"),
            {"c": [174.3542, -0.3106, 1.82e-4, -3.52e-7], "from_us": 1500.0, "to_us": 1900.0},
            "here: curves.main: positive branch does not rise from 1525 to 1900 us.*gives -1124 N at 1525 us",
        ),
        (
            ("curves", "main", "negative", "from_us"),
            1000.0,
            "curves.main: negative branch is not monotone: it turns at 109",
        ),
        (("sensors", "ping1d", "device"), "sonar", "here: sensors.ping1d.device: found 'sonar', wanted one of dvl75, "),
        (("sensors", "pilot"), {"device": "ping1d"}, "here: sensors.pilot: the stack has something else of this name"),
        (("sensors", "the-front"), {"device": "ping1d"}, "here: sensors.the-front: wanted a name of letters, digits"),
    ],
)
def test_mistakes_are_named(path: tuple[str | int, ...], value: object, sentence: str) -> None:
    changed = data()
    target: Any = changed
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    with pytest.raises(UsageError, match=sentence):
        build(Vehicle, changed, "here:")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="name one with --vehicle"):
        load_vehicle(tmp_path / "none.yaml")


def test_no_name_and_a_folder_are_reported_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"vehicle file: found no name, wanted one; .* -p vehicle:=FILE"):
        load_vehicle("")
    with pytest.raises(UsageError, match="found a folder, wanted a YAML file; give --vehicle FILE"):
        load_vehicle(tmp_path)


def test_broken_yaml_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.yaml"
    broken.write_text("name: [")
    with pytest.raises(UsageError, match="is not YAML"):
        load_vehicle(broken)


def test_binary_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "binary.yaml"
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match="cannot be read"):
        load_vehicle(broken)


def test_one_bar_is_ten_meters_of_water() -> None:
    # 1 bar is 10.19716 m of water, as tables of pressure units have it.
    assert Water().depth_m(201_325.0) == pytest.approx(10.19716, abs=1e-5)
    assert Water().depth_m(101_325.0) == 0.0


def test_one_sensor_measures_the_battery() -> None:
    both = {name: {"device": name, "port": "/dev/i2c-1"} for name in ("ina226", "ads1115")}
    with pytest.raises(UsageError, match="sensors: ina226 and ads1115 both measure the battery, wanted one of them"):
        build(Vehicle, data() | {"sensors": both}, "here:")
    assert build(Vehicle, data() | {"sensors": {"ina226": both["ina226"]}}, "here:").measuring("supply") == ("ina226",)


@pytest.mark.parametrize(
    ("rotation_deg", "measured"),
    [
        ((0.0, 0.0, 0.0), "altitude"),
        ((0.0, 40.0, 0.0), "altitude"),
        ((0.0, 90.0, 0.0), "range_ahead"),
        ((0.0, 60.0, 0.0), "range_ahead"),
        ((0.0, -90.0, 0.0), "range"),
        ((90.0, 0.0, 0.0), "range_aside"),
        ((180.0, 0.0, 0.0), "range"),
        ((0.0, 90.0, 90.0), "range_aside"),
    ],
)
def test_the_mount_says_what_a_range_is(rotation_deg: tuple[float, float, float], measured: str) -> None:
    """Pitched up by a right angle the z axis of a sensor looks ahead: Fossen 2011, eq. 2.18."""
    assert capabilities(Mount("ping1d", rotation_deg=rotation_deg)) == (measured,)


def test_sensors_of_one_kind_have_names_of_their_own() -> None:
    turned = {"device": "ping1d", "port": "/dev/hindrax/ahead", "rotation_deg": [0.0, 90.0, 0.0]}
    vehicle = build(Vehicle, data() | {"sensors": data()["sensors"] | {"ahead": turned}}, "here:")
    assert vehicle.measuring("altitude") == ("dvl75", "ping1d")
    assert vehicle.measuring("range_ahead") == ("ahead",)
    assert vehicle.measuring("depth") == ("ms5837",)


def test_an_output_channel_drives_one_thing() -> None:
    """Two on one ended every process of the thrusters, again and again."""
    assert load_vehicle(FILE).output_channels() == (*range(8), 8, 9)
    nine = data()
    nine["thrusters"].append({"name": "T9", "channel": 8, "position_m": [0.0, 0.0, 0.0]})
    with pytest.raises(UsageError, match=r"hindrax: output channel 8 drives T9 and a lamp, wanted one of them"):
        build(Vehicle, nine, "mine:").output_channels()
    nine["output"]["light_channels"] = []
    assert build(Vehicle, nine, "mine:").output_channels() == tuple(range(9))
    nine["thrusters"][-1]["channel"] = 3
    with pytest.raises(UsageError, match=r"output channel 3 drives T4 and T9"):
        build(Vehicle, nine, "mine:").output_channels()
