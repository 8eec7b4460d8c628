"""Settings of the driver of a DVL-75, and those in its flash."""

from collections.abc import Mapping
from dataclasses import dataclass

from hindrax_core.hydrostatics import Water
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec3
from hindrax_drivers.driver import sound_mps

POOL_MODE = "Pool Mode"
HEADING_OFFSET = "Heading offset"
BAUD_RATE = "Baud rate"
SETTINGS: Mapping[str, str] = {
    "DVPDL messages": "SEND-DVPDL",
    "DVEXT messages": "SEND-DVEXT",
    "DVPDX messages": "SEND-DVPDX",
    "DVKFA messages": "SEND-DVKFA",
    "Retweet GPS": "RETWEET-GPS",
    "Speed of sound": "SET-SPEED-OF-SOUND",
    "Velocity adjustment": "SET-VELOCITY-ADJUSTMENT",
    "Sensor Orientation": "SET-SENSOR-ORIENTATION",
    "Magnetic declination": "DECLINATION",
    HEADING_OFFSET: "HEADING-OFFSET",
    POOL_MODE: "SET-POOL-MODE",
    BAUD_RATE: "BAUD-RATE",
}
"""Key in $DVNVM and the command that sets it: the pairs of Cerulean's own OmniTrack web page.

The heading offset has no key known to us; it is sent whenever it is named.
"""
POOL_MODE_OF_A_DVL75 = {
    "ON": b"MANUAL-MODE 0.001,10.0,0.5,56,0.1,50,20.6,-0.671,100,100\n",
    "OFF": b"MANUAL-MODE OFF\n",
}
"""A DVL-75 knows no SET-POOL-MODE. These are the lines of Cerulean's extension of BlueOS (BlueOS-Cerulean-DVL)."""
IMU_CALIBRATION = {"grab": b"GRAB-IMU-CAL\n", "void": b"VOID-IMU-CAL\n"}
"""Keep the baseline IMU's calibration of this moment in flash, or delete it. Page "Commands Accepted by the DVL"."""
REBOOT = b"REBOOT\n"


@dataclass(frozen=True, slots=True)
class Dvl75Knobs:
    """Settings of the driver of the DVL, and of the DVL itself by `./hindrax dvl setup` only."""

    baud: int = knob(115200, 9600, 921600, "line speed [bit/s]")
    speed_of_sound_mps: float | None = knob(
        None, 1100.0, 1950.0, "speed of sound that the device uses; none: by the vehicle's water [m/s]"
    )
    velocity_adjustment: float = knob(1.0, 0.8, 1.25, "factor that the device applies to its velocities [-]")
    min_confidence: float = knob(0.5, 0.01, 1.0, "confidence below which there is no velocity [-]")
    axis_sign: Vec3 = knob((1.0, 1.0, 1.0), -1.0, 1.0, "signs that turn the device's x, y, z into FRD [-]")
    attitude_sign: Vec3 = knob((1.0, 1.0, 1.0), -1.0, 1.0, "signs that turn roll, pitch, heading into SNAME [-]")
    sigma_floor_mps: float = knob(0.01, 0.0, 1.0, "standard deviation of a velocity without rounding [m/s]")
    max_speed_mps: float = knob(5.0, 0.1, 20.0, "largest plausible velocity along an axis [m/s]")
    clock_drift_ppm: float = knob(200.0, 0.0, 1000.0, "largest accepted error of the device's clock rate [ppm]")
    latency_s: float = knob(0.0065, 0.0, 0.5, "end of interval to arrival: 75 characters at 115200 baud [s]")
    stall_s: float = knob(1.0, 0.3, 60.0, "silence that is reported [s]")
    enable_after_s: float = knob(2.0, 0.5, 60.0, "time without a delta before one is requested [s]")
    enable_tries: int = knob(3, 0, 100, "requests of deltas after a start [-]")

    def __post_init__(self) -> None:
        """Signs are signs."""
        for name, signs in (("axis_sign", self.axis_sign), ("attitude_sign", self.attitude_sign)):
            if any(abs(sign) != 1.0 for sign in signs):
                raise ValueError(f"{name}: found {signs}, wanted 1 or -1 for each axis")


DEFAULT_KNOBS, FRESH_WATER = Dvl75Knobs(), Water()


def wanted_settings(knobs: Dvl75Knobs, model: str = "DVL-75", water: Water = FRESH_WATER) -> dict[str, str]:
    """Flash settings that this driver wants, as $DVNVM reports them; the altitude comes with $DVEXT or $DVPDX.

    Parameters
    ----------
    knobs
        Of the driver.
    model
        As the device calls itself.
    water
        For the speed of sound.

    Returns
    -------
    dict[str, str]
        By their names.
    """
    return {
        "DVPDL messages": "ON",
        "DVPDX messages" if model == "Tracker 650" else "DVEXT messages": "ON",
        "Speed of sound": f"{sound_mps(knobs, water):.1f}",
        "Velocity adjustment": f"{knobs.velocity_adjustment:.3f}",
    }


def commands(current: Mapping[str, str], wanted: Mapping[str, str], always: bool = False) -> tuple[bytes, ...]:
    """Command lines that bring a device to the wanted settings. Page "Commands Accepted by the DVL".

    Settings live in flash, which wears: one that already holds is left alone.

    Parameters
    ----------
    current
        Of its $DVNVM; one that the device did not report is sent.
    wanted
        By their names.
    always
        Whether those that hold are sent too.

    Returns
    -------
    tuple[bytes, ...]
        Whole lines.
    """
    model = current.get("Model", "")
    return tuple(
        _command(key, value, model) for key, value in wanted.items() if always or not _same(current.get(key, ""), value)
    )


def _command(key: str, value: str, model: str) -> bytes:
    if key == POOL_MODE and model == "DVL-75":
        return POOL_MODE_OF_A_DVL75[value]
    return f"{SETTINGS[key]} {value}\n".encode("ascii")


def _same(found: str, wanted: str) -> bool:
    """Whether two values mean the same: words, or numbers between commas, which $DVNVM writes as semicolons."""
    try:
        pairs = zip(_numbers(found), _numbers(wanted), strict=True)
        return all(abs(one - other) < 5e-4 for one, other in pairs)
    except ValueError:
        return found.upper() == wanted.upper()


def _numbers(value: str) -> list[float]:
    return [float(part) for part in value.replace(";", ",").split(",")]
