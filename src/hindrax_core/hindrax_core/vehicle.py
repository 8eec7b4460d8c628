"""The vehicle file: mass, volume, thruster poses and curves, limits, sensor mounts, water and pool.

Frames: SNAME body axes (x forward, y starboard, z down); positions are from the body origin, which is the center of the
envelope. How the vehicle is *tuned* is not here; that is in ROS parameters declared from the nodes' knobs.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hindrax_core.errors import UsageError, cause
from hindrax_core.hydrostatics import GRAVITY_mps2, Water
from hindrax_core.knobs import block, build, choice, fact, knob
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.rotation import matrix, rotate
from hindrax_core.sensor_table import Capability, row_of
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.thrust.curves import Curve, problems_of

MOST_THRUSTERS = 16
"""Servo outputs of a PCA9685 (its datasheet, section 2) and of an autopilot."""
USUAL_V = 14.8
"""Four lithium cells, nominal."""

VEHICLE_OF_FRAME: Mapping[int, str] = {1: "bluerov2", 2: "bluerov2-heavy"}
"""Frame of ArduSub -> vehicle in the box: only for these a file can be made."""
OF_OUTPUT: Mapping[str, tuple[str, ...]] = {"ardusub": ("ardusub", "ardusub_ekf", "ardusub_range")}
"""Kinds of sensors that an output has on its own line."""
LAST_LINE = 127
AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
NAMED_OTHERWISE = frozenset(
    (
        *("sensors", "thrusters", "control", "navigator", "estimator_health", "pilot", "allocator", "identifier"),
        *("safety_monitor", "recorder", "mock", "replay", "operator", "thrust", "teleop", "navigation", "holds"),
        *("joy", "cmd_vel", "lights", "battery", "leak", "maneuver", "ident", "raw", "robot_description"),
    )
)
"""Names of nodes and topics of the stack, which a sensor cannot have."""
WITHIN = math.cos(math.radians(45.0))
"""Cosine of the angle to an axis up to which a beam looks along it."""
WRENCH_SYMBOLS = ("X", "Y", "Z", "K", "M", "N")
WRENCH_UNITS = ("N",) * 3 + ("N m",) * 3


@dataclass(frozen=True, slots=True)
class Pool:
    """A box of water: x along the length, y along the width, z down from the surface."""

    length_m: float = knob(10.0, 1.0, 1000.0, "length [m]")
    width_m: float = knob(6.0, 1.0, 1000.0, "width [m]")
    depth_m: float = knob(1.8, 0.5, 6000.0, "depth [m]")


@dataclass(frozen=True, slots=True)
class Thruster:
    """Pose, curve and output channel of one thruster. The direction is that of the force for a positive command."""

    name: str = fact(meaning="name, such as T1")
    position_m: Vec3 = fact(-100.0, 100.0, "position from the body origin [m]")
    azimuth_deg: float = knob(0.0, -360.0, 360.0, "direction of positive thrust, from x towards y [deg]")
    elevation_deg: float = knob(0.0, -90.0, 90.0, "positive thrust above the x-y plane, +90 is up [deg]")
    curve: str = knob("main", meaning="name of its curve under curves")
    channel: int = knob(0, 0, 15, "output channel [-]")
    reversed: bool = knob(False, meaning="a longer pulse pushes backwards")
    lag_s: float = knob(0.15, 0.0, 5.0, "time constant of the thrust [s]")

    @property
    def direction(self) -> Vec3:
        """Unit vector of positive thrust in body axes (z down). Multiples of 90 degrees are exact."""
        ca, sa = _cos_sin(self.azimuth_deg)
        ce, se = _cos_sin(self.elevation_deg)
        return (ce * ca, ce * sa, 0.0 - se)


@dataclass(frozen=True, slots=True)
class Drag:
    """F = k_q |x| x + k_l x for one degree of freedom (N, N m; m/s, rad/s). COB-2023-1394 eq. 2.

    `k_q_negative`, where given, is the quadratic coefficient for motion in the negative direction.
    """

    k_q: float = knob(0.0, 0.0, 1e6, "quadratic [N s^2/m^2, N m s^2]")
    k_l: float = knob(0.0, 0.0, 1e6, "linear [N s/m, N m s]")
    k_q_negative: float | None = knob(
        None, meaning="quadratic, for motion in the opposite direction [N s^2/m^2, N m s^2]"
    )
    k_l_negative: float | None = knob(None, meaning="linear, for motion in the opposite direction [N s/m, N m s]")

    def of(self, *, backward: bool) -> tuple[float, float]:
        """k_q and k_l of motion ahead, or of motion the other way."""
        k_q, k_l = (self.k_q_negative, self.k_l_negative) if backward else (None, None)
        return self.k_q if k_q is None else k_q, self.k_l if k_l is None else k_l

    def resistance(self, speed: float) -> float:
        """Force against a motion at a speed, positive with it [N, N m]."""
        if speed < 0.0:
            k_q, k_l = self.of(backward=True)
            return (k_q * -speed + k_l) * speed
        return (self.k_q * speed + self.k_l) * speed


@dataclass(frozen=True, slots=True)
class Hydrodynamics:
    """Prior of the hydrodynamics: for plans, and as truth of the mock; never given to the estimator."""

    added_mass: Vec6 = fact(0.0, 1e6, "diagonal added mass, surge to yaw [kg, kg m^2]")
    surge: Drag = field(default_factory=Drag)
    sway: Drag = field(default_factory=Drag)
    heave: Drag = field(default_factory=Drag)
    roll: Drag = field(default_factory=Drag)
    pitch: Drag = field(default_factory=Drag)
    yaw: Drag = field(default_factory=Drag)
    added_mass_cross: tuple[Vec6, ...] = knob(
        (), meaning="6 x 6, off-diagonal, need not be symmetric (rows: force; columns: acceleration) [kg, kg m, kg m^2]"
    )

    def drag(self, axis: str) -> Drag:
        """Return the drag of one SNAME axis by its name."""
        found: Drag = getattr(self, axis)
        return found


def chip_and_line(name: str, key: str) -> tuple[str, int]:
    """Return the chip and the line of a GPIO's name.

    Parameters
    ----------
    name
        `CHIP:LINE`, the chip by its label or name.
    key
        Where the vehicle file has it, for the error.

    Returns
    -------
    tuple[str, int]
        Label or name of the chip; number of the line, 0 to 127.

    Raises
    ------
    ValueError
        Unless the name has this form.
    """
    chip, _, line = name.rpartition(":")
    if not chip or not line.isdecimal() or int(line) > LAST_LINE:
        raise ValueError(f"{key}: found {name!r}, wanted CHIP:LINE, such as pinctrl-bcm2711:26")
    return chip, int(line)


ADDRESS_MEANING = "I2C address, none: the device's usual one; or line of a GPIO chip [-]"


@dataclass(frozen=True, slots=True)
class Mount:
    """Position, orientation (sensor to body: yaw, then pitch, then roll) and port of a sensor.

    The vehicle file names it as it likes: its node and its topics have that name.
    """

    device: str = fact(meaning="kind of sensor: of the table of sensors, or of an installed package")
    port: str = knob(
        "", meaning="port: /dev/i2c-1, udp://0.0.0.0:27000, tcp://192.168.2.95:16171, gpio:pinctrl-bcm2711"
    )
    address: int | None = knob(None, 0, 127, ADDRESS_MEANING)
    position_m: Vec3 = knob((0.0, 0.0, 0.0), -100.0, 100.0, "position from the body origin [m]")
    rotation_deg: Vec3 = knob((0.0, 0.0, 0.0), -360.0, 360.0, "roll, pitch, yaw of the sensor in body axes [deg]")
    calibration: Mapping[str, tuple[float, ...]] = block(dict, "written by its calibration command")
    data_ready: str = knob("", meaning="GPIO that an ICM-20948's INT1 is wired to, CHIP:LINE; it times the samples")

    def __post_init__(self) -> None:
        """Check the name of the line."""
        if self.data_ready:
            chip_and_line(self.data_ready, "data_ready")


def capabilities(mount: Mount) -> tuple[Capability, ...]:
    """What a sensor measures where it is mounted: a range downward is the altitude, forward the range ahead.

    Parameters
    ----------
    mount
        Kind of the sensor, and its rotation in the body (SNAME: roll, pitch, yaw).

    Returns
    -------
    tuple[Capability, ...]
        As the table of sensors has them, with the range named by its direction.

    Raises
    ------
    ValueError
        For an unknown kind of sensor.
    """
    measures = row_of(mount.device).measures
    if "range" not in measures:
        return measures
    roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
    forward, aside, down = rotate(matrix((roll, pitch, yaw)), (0.0, 0.0, 1.0))
    looks: Capability = "range_ahead" if forward > WITHIN else "range_aside" if abs(aside) > WITHIN else "range"
    looks = "altitude" if down > WITHIN else looks
    return tuple(looks if one == "range" else one for one in measures)


@dataclass(frozen=True, slots=True)
class Output:
    """Thruster output: a PCA9685 on an I2C bus, an STM32F407 on a serial port, an ArduSub over MAVLink, or forces."""

    device: str = choice("pca9685", ("pca9685", "stm32", "ardusub", "ros2_control"), "kind of output")
    port: str = knob(
        "/dev/i2c-1",
        meaning="port; of an ardusub: udpin:0.0.0.0:14550, udpout:192.168.2.2:14550, tcp:127.0.0.1:5760, /dev/ttyACM0; "
        "of ros2_control the topic of the forces, with {name} one for each thruster: /{name}_controller/reference",
    )
    control: str = choice(
        "manual_control", ("manual_control", "motor_test"), "how an ardusub is driven: by sticks, or each thruster"
    )
    address: int = knob(0x40, 0, 127, "I2C address [-]")
    rate_Hz: float = knob(200.0, 40.0, 400.0, "pulse rate [Hz]")
    clock_Hz: float | None = knob(
        None, 20e6, 50e6, "measured oscillator frequency of the PCA9685; none: not measured, nominally 25 MHz [Hz]"
    )
    external_clock: bool = knob(False, meaning="the PCA9685 has an external clock at EXTCLK")
    enable_line: str = knob("", meaning="GPIO that enables the outputs when low, CHIP:LINE (label or name of the chip)")
    enable_timer: bool = knob(False, meaning="a retriggerable timer drives OE; the line pulses at every write")
    light_channels: tuple[int, ...] = knob((8, 9), 0, 15, "output channels of the lamps")

    @property
    def on_line(self) -> bool:
        """Whether something with a mind of its own makes the pulses, at the far end of a line that carries bytes."""
        return self.device in ("stm32", "ardusub")

    @property
    def looks_s(self) -> float:
        """Time between two looks at pulses that somebody else makes: a change of them shows up to so late [s]."""
        return 0.02 if self.device == "ardusub" else 0.0

    def __post_init__(self) -> None:
        """A timer without its line would never enable the outputs."""
        if self.enable_line:
            chip_and_line(self.enable_line, "enable_line")
        if self.enable_timer and not self.enable_line:
            raise ValueError("enable_timer: found no enable_line, wanted the GPIO that triggers the timer")


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits for every source of commands."""

    wrench: Vec6 = knob((60.0, 60.0, 80.0, 20.0, 25.0, 30.0), 0.0, 1e6, "largest wrench per axis [N, N m]")
    speed_mps: float = knob(1.0, 0.0, 20.0, "largest speed through the water [m/s]")
    tilt_deg: float = knob(55.0, 0.0, 180.0, "largest roll or pitch [deg]")
    battery_V: float = knob(13.0, 0.0, 100.0, "lowest supply voltage [V]")


@dataclass(frozen=True, slots=True)
class AxisGain:
    """Thrust that acts on an axis over that of the curves, all losses at bollard included: by `hindrax weigh`."""

    load: float = fact(1e-3, 1e6, "thrust at which it was weighed [N, N m]")
    sigma: float = fact(0.0, 1.0, "standard deviation of the gain, the same both ways [-]")
    sigma_difference: float = knob(0.0, 0.0, 1.0, "standard deviation of half the difference of both ways [-]")
    positive: float | None = knob(None, 0.2, 5.0, "gain ahead, to starboard, down, clockwise; none: not weighed [-]")
    negative: float | None = knob(None, 0.2, 5.0, "gain in the opposite direction; none: not weighed [-]")

    def of(self, force: float) -> float:
        """Gain of a thrust of this sign [-]."""
        gain = self.positive if force > 0.0 else self.negative
        return 1.0 if gain is None else gain


@dataclass(frozen=True, slots=True)
class Commissioned:
    """Written by `./hindrax commission --write` when every claim of the file was proven."""

    geometry: str = fact(meaning="hash of the thrusters, mounts and outputs that were proven")
    date: str = fact(meaning="day on which they were, such as 2026-11-25")
    bag: str = knob("", meaning="record of it")


@dataclass(frozen=True, slots=True)
class Vehicle:
    """The whole file. Derived quantities (weight, buoyancy, inertia where none is given) are properties."""

    name: str = fact(meaning="name in reports and bags")
    mass_kg: float = fact(0.1, 1e5, "mass [kg]")
    volume_m3: float = fact(1e-5, 1e3, "displaced volume [m^3]")
    envelope_m: Vec3 = fact(0.01, 50.0, "length, width, height [m]")
    thrusters: tuple[Thruster, ...] = knob((), meaning="poses, curves and channels, see below")
    curves: Mapping[str, Curve] = block(dict, "thrust curves by name, see below")
    thrust_gain: Mapping[str, AxisGain] = block(dict, "gain of the thrust by axis, as `./hindrax weigh` writes it")
    hydrodynamics: Hydrodynamics | None = knob(None, meaning="estimate: prior for plans, truth for the mock")
    inertia_kgm2: Vec3 | None = knob(None, 1e-6, 1e8, "moments of inertia; none: of a homogeneous prism [kg m^2]")
    center_of_mass_m: Vec3 = knob((0.0, 0.0, 0.0), -10.0, 10.0, "center of mass from the body origin [m]")
    center_of_buoyancy_m: Vec3 = knob((0.0, 0.0, 0.0), -10.0, 10.0, "center of buoyancy from the body origin [m]")
    depth_rating_m: float = knob(60.0, 0.0, 12000.0, "depth rating [m]")
    supply_V: float = knob(
        USUAL_V, 5.0, 60.0, "supply without a battery sensor; in a file the default is the voltage of its curves [V]"
    )
    supply_ohm: float | None = knob(
        None, 0.0, 10.0, "resistance of battery, cables and plugs, by which the supply sags under load [ohm]"
    )
    projected_areas_m2: Vec3 | None = knob(None, 1e-4, 2500.0, "seen along x, y, z; for estimates from geometry [m^2]")
    losses: bool = knob(
        True,
        meaning="water, supply and tether take thrust that no curve has; false: a simulator, with thrusters alike",
    )
    water: Water = field(default_factory=Water)
    pool: Pool = field(default_factory=Pool)
    limits: Limits = field(default_factory=Limits)
    sensors: Mapping[str, Mount] = block(dict, "sensors by name, see below")
    output: Output = field(default_factory=Output)
    commissioned: Commissioned | None = knob(None, meaning="record of its proof, as `./hindrax commission` writes it")

    def __post_init__(self) -> None:
        """Check that names are unique and refer to existing things, and that every curve is valid."""
        for name, curve in self.curves.items():
            problems = problems_of(curve)
            if problems:
                raise ValueError(f"curves.{name}: {'; '.join(problems)}")
        self._check_sensors()
        for axis in self.thrust_gain:
            if axis not in AXES:
                raise ValueError(f"thrust_gain: found {axis!r}, wanted one of {', '.join(AXES)}")
        self._check_thrusters()

    def _check_sensors(self) -> None:
        for name, mount in self.sensors.items():
            try:
                row_of(mount.device)
            except ValueError as error:
                raise ValueError(f"sensors.{name}.device: {error}") from error
            if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) or "__" in name:
                raise ValueError(f"sensors.{name}: wanted a name of letters, digits and _, for its topics have it")
            if name in NAMED_OTHERWISE:
                raise ValueError(f"sensors.{name}: the stack has something else of this name, wanted such as my_{name}")
        supplied = self.measuring("supply")
        if len(supplied) > 1:
            raise ValueError(f"sensors: {' and '.join(supplied)} both measure the battery, wanted one of them")

    def _check_thrusters(self) -> None:
        if len(self.thrusters) > MOST_THRUSTERS:
            raise ValueError(f"thrusters: found {len(self.thrusters)}, wanted at most {MOST_THRUSTERS}")
        names = [thruster.name for thruster in self.thrusters]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"thrusters: name {name} is used {names.count(name)} times, wanted once")
        for index, thruster in enumerate(self.thrusters):
            if thruster.curve not in self.curves:
                known = ", ".join(self.curves) or "none"
                raise ValueError(f"thrusters[{index}].curve: found {thruster.curve!r}, wanted one of curves ({known})")

    def measuring(self, capability: Capability) -> tuple[str, ...]:
        """Names of the sensors on board that measure something, in the order of the file."""
        return tuple(name for name, mount in self.sensors.items() if capability in capabilities(mount))

    @property
    def on_output_line(self) -> tuple[str, ...]:
        """Names of the sensors that are on the line of the output: without a port, and of its kind."""
        kinds = OF_OUTPUT.get(self.output.device, ())
        return tuple(name for name, mount in self.sensors.items() if mount.device in kinds and not mount.port)

    def output_channels(self) -> tuple[int, ...]:
        """Channels of the output, checked: where a file is only identified with, they may be left out.

        Returns
        -------
        tuple[int, ...]
            Of the thrusters, in the order of the file, then of the lamps.

        Raises
        ------
        UsageError
            Where two share a channel.
        """
        users = [(thruster.channel, thruster.name) for thruster in self.thrusters]
        users += [(channel, "a lamp") for channel in self.output.light_channels]
        seen: dict[int, str] = {}
        for channel, user in users:
            if channel in seen:
                raise UsageError(
                    f"{self.name}: output channel {channel} drives {seen[channel]} and {user}, wanted one of them; "
                    "correct thrusters.channel or output.light_channels in the vehicle file"
                )
            seen[channel] = user
        return tuple(seen)

    @property
    def weight_N(self) -> float:
        """Mass times standard gravity."""
        return self.mass_kg * GRAVITY_mps2

    @property
    def buoyancy_N(self) -> float:
        """Weight of the displaced water."""
        return self.volume_m3 * self.water.density_kgpm3 * GRAVITY_mps2

    @property
    def net_buoyancy_N(self) -> float:
        """Buoyancy minus weight: positive floats."""
        return self.buoyancy_N - self.weight_N

    @property
    def characteristic_length_m(self) -> float:
        """Cube root of the displaced volume, the length of the Reynolds number in COB-2023-1394."""
        return float(self.volume_m3 ** (1.0 / 3.0))

    @property
    def inertia(self) -> Vec3:
        """Moments of inertia about x, y, z [kg m^2]: as given, or of a homogeneous prism (Eidsvik 2015 eq. 3.1)."""
        if self.inertia_kgm2 is not None:
            return self.inertia_kgm2
        L, W, H = self.envelope_m
        twelfth = self.mass_kg / 12.0
        return (twelfth * (W * W + H * H), twelfth * (L * L + H * H), twelfth * (W * W + L * L))


def _cos_sin(degrees: float) -> tuple[float, float]:
    quarter = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    angle = degrees % 360.0
    return quarter.get(angle) or (math.cos(math.radians(angle)), math.sin(math.radians(angle)))


def load_vehicle(path: str | Path) -> Vehicle:
    """Read and check a vehicle file.

    Parameters
    ----------
    path
        A YAML file; its keys are in `docs/reference/vehicle-file.md`.

    Returns
    -------
    Vehicle
        Frozen; SI units, SNAME axes, positions from the body's origin.

    Raises
    ------
    UsageError
        Names the file, the path of the key, what was found and what was wanted.
    """
    if not str(path):
        raise UsageError("vehicle file: found no name, wanted one; give --vehicle FILE, or -p vehicle:=FILE to a node")
    file = Path(path)
    if file.is_dir():
        raise UsageError(f"vehicle file {file}: found a folder, wanted a YAML file; give --vehicle FILE")
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"vehicle file {file}: cannot be read ({cause(error)}); name one with --vehicle") from error
    return vehicle_from_text(text, str(file))


def vehicle_from_text(text: str, source: str) -> Vehicle:
    """Check the text of a vehicle file; errors name `source`."""
    return build(Vehicle, _with_supply(read_yaml(text, f"vehicle file {source}")), f"{source}:")


def _with_supply(data: object) -> object:
    """The file with the supply of its curves, where it names none: thrust as measured, not scaled in silence."""
    curves = data.get("curves") if isinstance(data, Mapping) else None
    if not isinstance(data, Mapping) or "supply_V" in data or not isinstance(curves, Mapping):
        return data
    volts = next(filter(None, map(_supply_of, curves.values())), None)
    return data if volts is None else {**data, "supply_V": volts}


def _supply_of(curve: object) -> object:
    """The supply that a curve names, or the one nearest to the usual one of those in its table; None without."""
    if not isinstance(curve, Mapping):
        return None
    table = curve.get("table")
    rows = table.get("supply_V") if isinstance(table, Mapping) else None
    if isinstance(rows, list) and rows and all(isinstance(one, int | float) for one in rows):
        return min(max(USUAL_V, min(rows)), max(rows))
    return curve.get("supply_V")
