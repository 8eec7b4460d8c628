"""Settings of a Ping1D and the messages that set them."""

import struct
from dataclasses import dataclass

from hindrax_core.hydrostatics import Water
from hindrax_core.knobs import knob
from hindrax_drivers.driver import sound_mps
from hindrax_drivers.protocols import ping_protocol as protocol
from hindrax_drivers.protocols.ping_protocol import PingFrame


@dataclass(frozen=True, slots=True)
class Ping1dKnobs:
    """Settings of the sonar. With `mode_auto` it chooses scan and gain itself."""

    baud: int = knob(115200, 9600, 921600, "line speed [bit/s]")
    mode_auto: bool = knob(True, meaning="the sonar chooses scan and gain itself")
    range_start_m: float = knob(0.1, 0.0, 100.0, "start of the scan, mode_auto off [m]")
    range_length_m: float = knob(5.0, 1.0, 100.0, "length of the scan, mode_auto off [m]")
    gain: int = knob(2, 0, 6, "receiver gain, mode_auto off [-]")
    interval_s: float = knob(0.05, 0.01, 10.0, "time between pings [s]")
    speed_of_sound_mps: float | None = knob(
        None, 1300.0, 1700.0, "speed of sound that the device uses; none: by the vehicle's water [m/s]"
    )
    min_confidence: float = knob(0.5, 0.0, 1.0, "confidence below which a distance is refused [-]")
    continuous: bool = knob(True, meaning="continuous pings; otherwise each ping is requested")
    profile: bool = knob(False, meaning="request full echo profiles continuously")
    answer_s: float = knob(0.3, 0.05, 5.0, "timeout of an answer [s]")
    tries: int = knob(3, 1, 100, "tries of a command [-]")
    latency_s: float = knob(0.0, 0.0, 0.5, "end of scan to first byte, beyond the known delay [s]")
    stall_s: float = knob(1.0, 0.3, 60.0, "silence that is reported and answered by a restart [s]")


DEFAULT_KNOBS, FRESH_WATER = Ping1dKnobs(), Water()


@dataclass(frozen=True, slots=True)
class DeviceSetting:
    """One wanted setting. The message `proof` reports its value for verification (0: no message does)."""

    name: str
    message: int
    payload: bytes
    proof: int

    @property
    def frames(self) -> bytes:
        """The set message and, if the value can be read back, its request."""
        asked = protocol.request(self.proof) if self.proof and self.proof != protocol.PROFILE else b""
        return protocol.encode(self.message, self.payload) + asked

    def holds(self, frame: PingFrame) -> bool:
        """Whether a message with the id of the proof reports the wanted value."""
        if frame.id == protocol.PROFILE:
            return True
        return int.from_bytes(frame.payload, "little") == int.from_bytes(self.payload, "little")


def device_settings(knobs: Ping1dKnobs, water: Water = FRESH_WATER) -> list[DeviceSetting]:
    """All settings of a sonar after power-up, in order."""
    mm_per_s = struct.pack("<I", round(sound_mps(knobs, water) * 1000.0))
    scan = struct.pack("<II", round(knobs.range_start_m * 1000.0), round(knobs.range_length_m * 1000.0))
    interval = struct.pack("<H", round(knobs.interval_s * 1000.0))
    stream = struct.pack("<H", protocol.PROFILE)
    by_hand = [
        DeviceSetting("range", protocol.SET_RANGE, scan, protocol.RANGE),
        DeviceSetting("gain", protocol.SET_GAIN, bytes([knobs.gain]), protocol.GAIN),
    ]
    return [
        DeviceSetting("speed of sound", protocol.SET_SPEED_OF_SOUND, mm_per_s, protocol.SPEED_OF_SOUND),
        DeviceSetting("mode", protocol.SET_MODE_AUTO, bytes([knobs.mode_auto]), protocol.MODE_AUTO),
        *([] if knobs.mode_auto else by_hand),
        DeviceSetting("ping interval", protocol.SET_INTERVAL, interval, protocol.INTERVAL),
        DeviceSetting("ping enable", protocol.SET_PING_ENABLE, b"\x01", protocol.PING_ENABLE),
        DeviceSetting("continuous start", protocol.CONTINUOUS_START, stream, protocol.PROFILE)
        if knobs.continuous
        else DeviceSetting("continuous stop", protocol.CONTINUOUS_STOP, stream, 0),
    ]
