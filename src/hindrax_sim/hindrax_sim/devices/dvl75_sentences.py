"""Sentences of an emulated DVL-75, after its format pages and captured lines."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor

from hindrax_core.readings import Vec3
from hindrax_core.rotation import matrix, rotate
from hindrax_sim.physics.geometry import quaternion

BEAM_rad = math.radians(30.0)
BEAM_AZIMUTHS_rad = (-0.5 * math.pi, 0.5 * math.pi, 0.0, math.pi)
"""Assumed: beams A to D lie 30 degrees off the axis towards port, starboard, bow and stern."""
NO_BEAMS = "25,25,25,25,F,F,F,F,0.0000,0.0000,0.0000,0.0000,-1.000,-1.000,-1.000,-1.000"


@dataclass(frozen=True, slots=True)
class DvlTruth:
    """Truth of a DVL. Velocity, travel and turn are over ground, in the sensor's axes (forward, starboard, down).

    `travel_m` and `turned_rad`, where given, are sums since some start; the deltas are then their differences.
    Otherwise the velocity is integrated from one `step` to the next. `altitude_m` is the distance along the sensor's
    axis, None when there is no echo. `frozen`: the instrument measures no more and repeats its last delta.
    """

    velocity_mps: Vec3 = (0.0, 0.0, 0.0)
    attitude_rad: Vec3 = (0.0, 0.0, 0.0)
    altitude_m: float | None = 2.0
    travel_m: Vec3 | None = None
    turned_rad: Vec3 = (0.0, 0.0, 0.0)
    speed_of_sound_mps: float = 1484.0
    frozen: bool = False


@dataclass(frozen=True, slots=True)
class DvlSettings:
    """Flash settings of the device; the defaults are those of the factory. Angles in degrees."""

    deltas: bool = False
    extended: bool = True
    freeform: bool = True
    kalman: bool = False
    minimum: bool = False
    retweet_gps: bool = False
    speed_of_sound_mps: float = 1484.0
    velocity_adjustment: float = 1.0
    declination_deg: float = 0.0
    heading_offset_deg: float = 0.0
    orientation_deg: Vec3 = (0.0, 0.0, 0.0)
    imu_calibrated: bool = True
    pool_mode: bool = False
    baud: int = 115200


@dataclass(frozen=True, slots=True)
class Track:
    """Lock, intervals without one (negative), latitude and longitude [deg], noise of the four beams [m/s]."""

    locked: bool
    skips: int
    place_deg: tuple[float, float]
    noise_mps: Sequence[float]


def delta(end_us: int, span_us: int, moved_m: Vec3, turned_rad: Vec3, confidence: int) -> bytes:
    """Make $DVPDL by the clock of the device. Page "$DVPDL: DVL Position and Angle Deltas Message".

    Parameters
    ----------
    end_us, span_us : [us]
        End of the interval, and its length.
    moved_m, turned_rad : (3,) [m], [rad]
        Ground covered and angle turned in it, in the axes of the device.
    confidence : [%]
        Zero without bottom lock.

    Returns
    -------
    bytes
        With checksum and line end.
    """
    angles = "".join(f",{angle:.6f}" for angle in turned_rad)
    ways = "".join(f",{way:.3f}" for way in moved_m)
    return sentence(f"DVPDL,{end_us},{span_us}{angles}{ways},{confidence}")


def extended(truth: DvlTruth, settings: DvlSettings, span_us: int, track: Track) -> bytes:
    """Make $DVEXT with the empty field at its end. Page "$DVEXT: DVL Extended Data".

    Parameters
    ----------
    truth
        What the head senses.
    settings
        Declination, offset of the heading, calibration.
    span_us : [us]
        Since the sentence before.
    track
        Bottom lock, place by dead reckoning, and the noise of its velocities.

    Returns
    -------
    bytes
        With checksum and line end.
    """
    locked = track.locked
    roll, pitch, heading = (math.degrees(angle) for angle in truth.attitude_rad)
    heading += settings.declination_deg + settings.heading_offset_deg
    altitude = truth.altitude_m if locked and truth.altitude_m is not None else 0.0
    north, east, up = over_ground(truth) if locked else (0.0, 0.0, 0.0)
    calibration = "3333" if settings.imu_calibrated else "0000"
    head = f"{'T' if locked else 'F'},X,{calibration},{roll:.1f},{pitch:.1f},{heading % 360.0:.1f},{track.skips}"
    reckoned = ",".join(f"{degrees:.9f}" for degrees in track.place_deg)
    place = f"{up:.3f},{altitude:.2f},{north:.3f},{east:.3f},{reckoned},{span_us * 1e-6:.3f}"
    # Of the sensor head in axes east, north, up, with roll and pitch as given and zero heading towards east.
    turn = (truth.attitude_rad[0], -truth.attitude_rad[1], 0.5 * math.pi - truth.attitude_rad[2])
    head_turn = ",".join(f"{part:.6f}" for part in quaternion(turn))
    beams = _beams(truth.velocity_mps, altitude, track.noise_mps) if locked else NO_BEAMS
    return sentence(f"DVEXT,{head},{place},{head_turn},{beams},")


def kalman(sequence: int, span_us: int) -> bytes:
    """$DVKFA as far as its page goes: version, sequence, interval; it names no field of the groups."""
    return sentence(f"DVKFA,15,{sequence},{span_us * 1e-6:.6f}")


def minimum(seconds: float, place_deg: tuple[float, float], fix: bool) -> bytes:
    """Make $GPRMC of the place by dead reckoning. NMEA 0183, RMC.

    Parameters
    ----------
    seconds : [s]
        Time of the day.
    place_deg : (2,) [deg]
        Latitude and longitude, positive north and east.
    fix
        Whether a position was given to it, so that the sentence is valid.

    Returns
    -------
    bytes
        With checksum and line end.
    """
    hours, minutes = divmod(int(seconds) // 60, 60)
    latitude, longitude = place_deg
    north = f"{_degrees_minutes(latitude, 2)},{'S' if latitude < 0.0 else 'N'}"
    east = f"{_degrees_minutes(longitude, 3)},{'W' if longitude < 0.0 else 'E'}"
    time = f"{hours % 24:02d}{minutes:02d}{seconds % 60.0:05.2f}"
    return sentence(f"GPRMC,{time},{'A' if fix else 'V'},{north},{east},0.0,0.0,010100,,")


def _degrees_minutes(degrees: float, digits: int) -> str:
    whole, minutes = divmod(round(abs(degrees) * 60e4), 60 * 10_000)
    return f"{whole:0{digits}d}{minutes / 1e4:07.4f}"


def configuration(settings: DvlSettings) -> bytes:
    """Make the answer to CONFIGURATION. Keys as on the page "$DVNVM" and in Cerulean's OmniTrack.

    Neither has a key for the heading offset, nor one for the pool mode of a DVL-75.

    Parameters
    ----------
    settings
        Of the device now.

    Returns
    -------
    bytes
        A headline, then $DVNVM with a pair for each setting.
    """
    pairs = {
        "Model": "DVL-75",
        "DVEXT messages": _on(settings.extended),
        "DVPDL messages": _on(settings.deltas),
        "DVKFA messages": _on(settings.kalman),
        "Retweet GPS": _on(settings.retweet_gps),
        "Freeform messages": _on(settings.freeform),
        "Speed of sound": f"{settings.speed_of_sound_mps:.1f}",
        "Velocity adjustment": f"{settings.velocity_adjustment:.3f}",
        "Magnetic declination": f"{settings.declination_deg:.1f}",
        "Sensor Orientation": ";".join(f"{angle:g}" for angle in settings.orientation_deg),
        "Baud rate": f"{settings.baud}",
        "Firmware": "Oct 1 2021",
    }
    listed = "".join(f"{key}={value}," for key, value in pairs.items())
    return b"=========== DVL-75 ============\r\n" + sentence(f"DVNVM,{listed}")


def sentence(body: str) -> bytes:
    """Add `$`, checksum and line end to a body."""
    total = reduce(xor, body.encode("ascii"))
    return f"${body}*{total:02X}\r\n".encode("ascii")


def over_ground(truth: DvlTruth) -> Vec3:
    """Velocity north, east, up."""
    north, east, down = rotate(matrix(truth.attitude_rad), truth.velocity_mps)
    return (north, east, 0.0 - down)


def _beams(velocity_mps: Vec3, altitude_m: float, noise_mps: Sequence[float]) -> str:
    """Gain, lock, velocity and range of the four beams."""
    u, v, w = velocity_mps
    gain, reach = min(66, 19 + round(altitude_m)), altitude_m / math.cos(BEAM_rad)
    aside = [math.cos(azimuth) * u + math.sin(azimuth) * v for azimuth in BEAM_AZIMUTHS_rad]
    along = [math.sin(BEAM_rad) * one + math.cos(BEAM_rad) * w for one in aside]
    speeds = ",".join(f"{speed + noise:.4f}" for speed, noise in zip(along, noise_mps, strict=True))
    return f"{','.join([str(gain)] * 4)},T,T,T,T,{speeds},{','.join([f'{reach:.3f}'] * 4)}"


def _on(switch: bool) -> str:
    return "ON" if switch else "OFF"
