"""Recordings of BlueOS: the same record as of the telemetry that they hold, finished or not, old or new.

They are written here after the sources that `records.blueos_recording` names, with the texts that serde makes.
"""

import io
import json
import re
import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from pymavlink.dialects.v20 import ardupilotmega

from hindrax_analysis.identification.record_identification import open_sources
from hindrax_analysis.records.autopilot_log import read_log
from hindrax_analysis.records.autopilot_vehicle import logged_wiring
from hindrax_analysis.records.blueos_recording import recordings
from hindrax_analysis.records.recording import Recording
from hindrax_analysis.records.third_party_bag import TopicSelection
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle

ROV = load_vehicle(default_vehicle())
PULSES = [1600, 1450, 1550, 1500, 1500, 1580, 1500, 1420]
STEPS, CLAIMED, CONSTANT_POSITION = 30, 0x1F, 0x1F | 1 << 7
PARAMETERS = {"FRAME_CONFIG": 2.0} | {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 9)} | {"MOT_3_DIRECTION": -1.0}

HEAD, FOOTER = struct.Struct(">Q"), struct.Struct("<QQI")
DATA_END_B = 13
"""Length of the record behind the last chunk."""
FLAGS = {
    1 << bit: name
    for bit, name in enumerate((
        "EKF_ATTITUDE", "EKF_VELOCITY_HORIZ", "EKF_VELOCITY_VERT", "EKF_POS_HORIZ_REL", "EKF_POS_HORIZ_ABS",
        "EKF_POS_VERT_ABS", "EKF_POS_VERT_AGL", "EKF_CONST_POS_MODE",
    ))
}  # fmt: skip


def packed(received_us: int, message: ardupilotmega.MAVLink_message, system: int = 1) -> bytes:
    return struct.pack(">Q", received_us) + bytes(message.pack(ardupilotmega.MAVLink(None, srcSystem=system)))


def recording(
    telemetry: Iterable[bytes],
    *,
    router: bool = True,
    old: bool = False,
    finished: bool = True,
    packed: bool = True,
) -> bytes:
    """Write an MCAP file.

    Parameters
    ----------
    telemetry
        Packets of a .tlog, each behind its time of receipt [us].
    router
        Whether it has the topic of all messages.
    old
        Whether texts and flags are written as older versions of rust-mavlink did.
    finished
        Whether it ends in its index; else in its last chunk, as where the power was cut.
    packed
        Whether its chunks are compressed, with checksums.

    Returns
    -------
    bytes
        The file.
    """
    out, link, channels = io.BytesIO(), ardupilotmega.MAVLink(None), dict[str, int]()
    compression = CompressionType.ZSTD if packed else CompressionType.NONE
    writer = Writer(out, compression=compression, enable_crcs=packed)
    writer.start()
    schema = writer.register_schema("mavlink", "jsonschema", b'{"type": "object"}')
    for packet in telemetry:
        (received_us,) = HEAD.unpack_from(packet)
        message = link.decode(bytearray(packet[HEAD.size :]))
        head = {"system_id": message.get_srcSystem(), "component_id": message.get_srcComponent(), "sequence": 0}
        data = json.dumps({"header": head, "message": _fields(message, old=old)}).encode()
        kind = f"mavlink/{message.get_srcSystem()}/{message.get_srcComponent()}/{message.get_type()}"
        for topic in ("mavlink/out", kind) if router else (kind,):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schema)
            writer.add_message(channels[topic], 1000 * received_us, data, 1000 * received_us)
    writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    content = out.getvalue()
    (summary_at, _, _) = FOOTER.unpack_from(content, len(content) - FOOTER.size - len(MCAP0_MAGIC))
    return content if finished else content[: summary_at - DATA_END_B]


def _fields(message: ardupilotmega.MAVLink_message, *, old: bool) -> dict[str, object]:
    found: dict[str, object] = {"type": message.get_type()}
    for name in message.get_fieldnames():
        value = getattr(message, name)
        if name == "flags":
            value = {"bits": value} if old else " | ".join(text for bit, text in FLAGS.items() if value & bit)
        elif isinstance(value, str):
            value = [ord(one) for one in value.ljust(16, "\0")] if old else value
        found["mavtype" if name == "type" else name] = value
    return found


def telemetry(flags: int = CLAIMED) -> Iterator[bytes]:
    for step in range(STEPS):
        at_ms = 5000 + 100 * step
        for message in (
            ardupilotmega.MAVLink_ekf_status_report_message(flags, *[0.0] * 6),
            ardupilotmega.MAVLink_attitude_message(at_ms, 0.1, -0.2, 3.1, 0.01, 0.02, 0.3),
            ardupilotmega.MAVLink_local_position_ned_message(at_ms, 0.0, 0.0, 1.0, 0.4, 0.01 * step, 0.05),
            ardupilotmega.MAVLink_servo_output_raw_message(1000 * at_ms, 0, *PULSES),
            ardupilotmega.MAVLink_sys_status_message(0, 0, 0, 0, 14_200, 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            yield packed(1_700_000_000_000_000 + 1000 * at_ms, message)


def read(tmp_path: Path, name: str, content: bytes) -> Recording:
    file = tmp_path / name
    file.write_bytes(content)
    (one,) = read_log(file, ROV)
    return one


FORMS: dict[str, Callable[[Iterator[bytes]], bytes]] = {
    "today": recording,
    "old texts": lambda packets: recording(packets, old=True),
    "a topic of each kind": lambda packets: recording(packets, router=False),
    "power cut": lambda packets: recording(packets, finished=False),
    "power cut, a topic of each kind": lambda packets: recording(packets, router=False, finished=False),
}


@pytest.mark.parametrize("form", list(FORMS))
@pytest.mark.parametrize("flags", [CLAIMED, CONSTANT_POSITION])
def test_it_is_the_record_of_its_telemetry(form: str, flags: int, tmp_path: Path) -> None:
    wanted = read(tmp_path, "dive.tlog", b"".join(telemetry(flags)))
    found = read(tmp_path, "dive.mcap", FORMS[form](telemetry(flags)))
    assert np.isfinite(found.velocity[:, 0]).any() == (flags == CLAIMED)
    for name in ("velocity_t", "velocity", "wrench_t", "wrench", "attitude_t", "attitude"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-6, atol=1e-9)
    assert found.assumptions == wanted.assumptions


@pytest.mark.parametrize("old", [False, True])
def test_its_parameters_name_the_vehicle(old: bool, tmp_path: Path) -> None:
    values = (
        packed(
            1_700_000_000_000_000,
            ardupilotmega.MAVLink_param_value_message(name.encode(), value, 9, len(PARAMETERS), index),
        )
        for index, (name, value) in enumerate(PARAMETERS.items())
    )
    file = tmp_path / "dive.mcap"
    file.write_bytes(recording([*values, *telemetry()], old=old))
    wiring = logged_wiring([file])
    assert wiring is not None
    assert (wiring.kind, wiring.turned) == ("bluerov2-heavy", (3,))


def test_without_a_parameter_it_says_which_vehicles_it_can_be(tmp_path: Path) -> None:
    """BlueOS records while the vehicle is armed, and the parameters go over the link before."""
    file = tmp_path / "dive.mcap"
    file.write_bytes(recording(telemetry()))
    assert logged_wiring([file]) is None
    with pytest.raises(UsageError, match=r"no parameter .* by --vehicle: bluerov2, bluerov2-heavy, or a vehicle file"):
        open_sources([file], TopicSelection())


def test_messages_of_a_ground_station_and_what_is_no_message_are_left_out(tmp_path: Path) -> None:
    """The router's topic has all that it passes on."""
    station = packed(1_700_000_000_000_000, ardupilotmega.MAVLink_attitude_message(99, *[0.0] * 6), system=255)
    content = recording([*telemetry(), station], finished=False)
    found = read(tmp_path, "dive.mcap", content)
    assert "messages of other vehicles (MAVLink system 255) are left out" in found.assumptions
    assert len(found.wrench_t) == STEPS


def test_the_files_of_a_folder_are_records_and_others_are_left(tmp_path: Path) -> None:
    for index in (1, 2):
        (tmp_path / f"recorder_20260{index}01_101010.mcap").write_bytes(recording(telemetry()))
    (tmp_path / "recorder_20260301_101010.mcap").write_bytes(recording([]))  # never armed
    assert len(recordings(tmp_path)) == 2
    assert len(open_sources([tmp_path], TopicSelection(), ROV)) == 2


@pytest.mark.parametrize("content", [b"", b"hello", recording([])])
def test_what_is_no_recording_is_read_as_a_bag(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "x.mcap"
    file.write_bytes(content)
    assert recordings(file) == []
    with pytest.raises(UsageError, match=r"x\.mcap: "):
        open_sources([file], TopicSelection(), ROV)


def test_a_message_that_is_no_mavlink_costs_itself_and_many_are_refused(tmp_path: Path) -> None:
    content = recording(telemetry(), finished=False)
    whole = read(tmp_path, "dive.mcap", content)
    assert not any("damaged" in one for one in whole.assumptions)
    bare = recording(telemetry(), finished=False, packed=False)
    once = bare.replace(b'"message": {"type": "SERVO', b'"massage": {"type": "SERVO', 1)
    found = read(tmp_path, "once.mcap", once)
    assert len(found.wrench_t) == STEPS - 1
    assert "the file is damaged in 1 place; what is no message there is left out" in found.assumptions
    with pytest.raises(UsageError, match=r"often\.mcap: is damaged in 30 places, .*; copy it again"):
        read(tmp_path, "often.mcap", bare.replace(b'"message": {"type": "SERVO', b'"massage": {"type": "SERVO'))


@pytest.mark.parametrize(
    "odd", ["null", '"text"', "[1, 2]", '{"type": "X"}', "1e999", "-1", "true", "[" * 3000 + "]" * 3000]
)
@pytest.mark.parametrize("field", ["time_boot_ms", "time_usec", "servo1_raw", "flags", "voltage_battery", "system_id"])
def test_a_value_that_no_message_has_costs_its_message(field: str, odd: str, tmp_path: Path) -> None:
    bare = recording(telemetry(), finished=False, packed=False).decode("latin-1")
    begin = bare.index(f'"{field}": ', len(bare) // 2)
    value = re.match(r'"\w+": ("[^"]*"|[^,}]*)', bare[begin:])
    assert value is not None
    # Cut to the length that the record has: what is left of it is no JSON any more, and that is odd as well.
    new = f'"{field}": {odd}'[: len(value[0])].ljust(len(value[0]))
    file = tmp_path / "dive.mcap"
    for text in (bare[:begin] + new + bare[begin + len(value[0]) :], _again(bare, field, odd)):
        file.write_bytes(text.encode("latin-1"))
        try:
            found = read_log(file, ROV)
        except UsageError:
            continue
        assert sum(len(one.wrench_t) for one in found) >= STEPS - 2


def _again(bare: str, field: str, odd: str) -> str:
    """The recording with one more message at its end, whose field has an odd value."""
    head: dict[str, object] = {"system_id": "@" if field == "system_id" else 1}
    kind = {"flags": "EKF_STATUS_REPORT", "voltage_battery": "SYS_STATUS", "time_boot_ms": "ATTITUDE"}
    message: dict[str, object] = {"type": kind.get(field, "SERVO_OUTPUT_RAW"), "port": 0, "time_usec": 9_000_000}
    message |= {} if field == "system_id" else {field: "@"}
    content = {"header": head, "message": message}
    data = json.dumps(content).replace('"@"', odd).encode()
    record = struct.pack("<HIQQ", 1, 0, 2 * 10**18, 2 * 10**18) + data
    return bare + (b"\x05" + struct.pack("<Q", len(record)) + record).decode("latin-1")
