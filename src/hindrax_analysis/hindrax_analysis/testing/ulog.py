"""A minimal writer of PX4's logs, from its guide, "ULog File Format": header, formats, subscriptions, data."""

import struct
from collections.abc import Iterable, Iterator

CODES = {"uint64_t": "Q", "float": "f", "bool": "?"}
FORMATS = {
    "vehicle_local_position": "uint64_t timestamp;uint64_t timestamp_sample;float vx;float vy;float vz;"
    "bool v_xy_valid;bool v_z_valid;",
    "vehicle_attitude": "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;",
    "vehicle_angular_velocity": "uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;",
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;",
    "actuator_outputs": "uint64_t timestamp;float[16] output;",
    "battery_status": "uint64_t timestamp;float voltage_v;",
}
TOPICS = list(FORMATS)


def ulog(rows: Iterable[tuple[str, int, tuple[float, ...]]]) -> Iterator[bytes]:
    """Bytes of a log of messages: topic, instance (0 or 1), and its numbers; times in us."""
    yield b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    yield _message("B", bytes(40))
    for topic, fields in FORMATS.items():
        yield _message("F", f"{topic}:{fields}".encode())
    for number, topic in enumerate(TOPICS):
        for instance in (0, 1):
            yield _message("A", struct.pack("<BH", instance, 2 * number + instance) + topic.encode())
    for topic, instance, values in rows:
        yield _message("D", struct.pack(f"<H{_code(topic)}", 2 * TOPICS.index(topic) + instance, *values))


def _message(kind: str, content: bytes) -> bytes:
    return struct.pack("<Hc", len(content), kind.encode()) + content


def _code(topic: str) -> str:
    """Format of Python of the fields of a topic."""
    kinds = [field.split()[0].rstrip("]").partition("[") for field in FORMATS[topic].strip(";").split(";")]
    return "".join(f"{count}{CODES[kind]}" for kind, _, count in kinds)
