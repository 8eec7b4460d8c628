"""Bags that rosbag2 has compressed: each message by itself (`--compression-mode message`), or each file as a whole.

A compressed message is recognized by its own first bytes. metadata.yaml says it too, but a file that is copied leaves
that behind, and the two kinds cannot be confused: CDR begins with a zero byte (OMG DDS-XTypes 1.3, 7.6.2.1.2: no
representation identifier is above 0x00ff), the frame of a compressor never does.
"""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lz4.frame import LZ4FrameDecompressor, LZ4FrameFile
from zstandard import ZstdDecompressor, frame_content_size

from hindrax_bag.metadata import COMPRESSED
from hindrax_bag.read.mcap_records import BROKEN, MOST_B
from hindrax_core.errors import HindraxError, UsageError

PLAIN = b"\x00"
"""First byte of CDR, whatever its byte order."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame (RFC 8878, 3.1.1)."""
LZ4 = b"\x04\x22\x4d\x18"
"""First bytes of an LZ4 frame (LZ4 frame format 1.6.3, general structure)."""


def unpacked(data: bytes) -> bytes:
    """One message as it was before the compressor. At most `MOST_B` are unpacked, whatever the frame claims.

    Parameters
    ----------
    data
        As recorded, by Zstandard, LZ4 or not compressed at all.

    Returns
    -------
    bytes
        Plain CDR; what no compressor has written stays as it is.

    Raises
    ------
    ValueError
        And its kin of the libraries, when it is damaged or too large.
    """
    if data.startswith(PLAIN):
        return data
    if data.startswith(ZSTD):
        found = ZstdDecompressor().stream_reader(data).read(MOST_B + 1)
        wanted = frame_content_size(data)
        if 0 <= wanted != len(found):
            raise ValueError(f"{len(found)} bytes, {wanted} in the head of the frame")
    elif data.startswith(LZ4):
        found = LZ4FrameDecompressor().decompress(data, MOST_B + 1)
    else:
        return data
    if len(found) > MOST_B:
        raise ValueError(f"more than {MOST_B} bytes in one message")
    return found


@contextmanager
def unpacked_file(file: Path) -> Iterator[Path]:
    """Unpack a compressed file for as long as the block lasts.

    Parameters
    ----------
    file
        Compressed, by its suffix, or not.

    Yields
    ------
    Path
        The file itself, or its content in a temporary folder.

    Raises
    ------
    UsageError
        When it cannot be unpacked.
    HindraxError
        When the temporary folder has no room.
    """
    if file.suffix not in COMPRESSED:
        yield file
        return
    with tempfile.TemporaryDirectory(prefix="hindrax-bag-") as folder:
        place = Path(folder) / file.stem
        _unpack(file, place)
        yield place


def _unpack(file: Path, place: Path) -> None:
    try:
        packed = file.open("rb")
    except OSError as error:
        raise UsageError(f"{file}: cannot be read ({error.strerror})") from error
    with packed, place.open("wb") as target:
        source = LZ4FrameFile(packed) if file.suffix == ".lz4" else ZstdDecompressor().stream_reader(packed)
        while True:
            try:
                part = source.read(1 << 20)
            except BROKEN as error:
                raise UsageError(f"{file}: cannot be unpacked ({error}); copy it again") from error
            if not part:
                return
            try:
                target.write(part)
            except OSError as error:
                free = shutil.disk_usage(place.parent).free
                raise HindraxError(
                    f"{file}: no room to unpack it in {place.parent.parent} ({free / 1e6:.0f} MB free); "
                    "name a folder with room: export TMPDIR=/folder"
                ) from error
