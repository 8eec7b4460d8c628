"""A bag on disk: a folder of MCAP files with the ROS 2 profile and, beside them, the metadata.yaml of rosbag2.

A restarted recorder continues in the next file of the bag and leaves existing files unchanged.

The caller flushes it at least every second of wall time, so that a power cut costs no more. Splitting, the budget of
the disk and what is done when it is used up are decided at a flush; each decision is returned as a sentence.
"""

import os
import re
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.writer import CompressionType, Writer

from hindrax_bag.definitions import Lookup, definition
from hindrax_bag.metadata import (
    Channel,
    Contents,
    channel_metadata,
    is_whole,
    lock,
    part_number,
    parts,
    try_lock,
    write_metadata,
)
from hindrax_bag.write.limits import BagLimits, free_bytes
from hindrax_core.errors import HindraxError, cause
from hindrax_core.events import NS_PER_S

LIBRARY = "hindrax"
CHUNK_BYTES = 262_144
ROOM_AGAIN = 1.5
"""Recording continues when so many times the space kept free is available again."""


class BagFile:
    """Writes one file of the bag: ROS 2 profile, zstd chunks with checksums, index at the end.

    A file is never overwritten: FileExistsError. It is locked as long as it is written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.contents = Contents(path.name)
        """Bytes written so far."""
        self._numbers: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("xb")
        lock(self._file)
        self._mcap = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._mcap.start("ros2", LIBRARY)

    @property
    def size_bytes(self) -> int:
        """Bytes written so far; the open chunk is not among them."""
        return self._file.tell()

    def has(self, topic: str) -> bool:
        """Whether the channel of a topic is open."""
        return topic in self._numbers

    def open_channel(self, channel: Channel, definition: str, encoding: str = "ros2msg") -> None:
        """Declare a topic and, where it is the first of its type, its schema.

        Parameters
        ----------
        channel
            Topic, type and QoS.
        definition
            Text of the type.
        encoding
            Of the definition, as MCAP names it.
        """
        if channel.type not in self._schemas:
            self._schemas[channel.type] = self._mcap.register_schema(channel.type, encoding, definition.encode())
        schema, metadata = self._schemas[channel.type], channel_metadata(channel)
        self._numbers[channel.topic] = self._mcap.register_channel(channel.topic, "cdr", schema, metadata)
        self.contents.channels += (channel,)

    def write(self, topic: str, data: bytes, received: int, sent: int) -> None:
        """Append one message of an open channel.

        Parameters
        ----------
        topic
            Of an open channel.
        data
            CDR.
        received, sent
            Times [ns].
        """
        self._mcap.add_message(self._numbers[topic], received, data, sent)
        contents = self.contents
        contents.counts[topic] += 1
        if received < contents.first or not contents.first:
            contents.first = received
        contents.last = max(received, contents.last)

    def attach(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside.

        Parameters
        ----------
        name, media_type
            As MCAP has them, such as vehicle.yaml and application/yaml.
        data
            Content.
        stamp
            Its time [ns].
        """
        self._mcap.add_attachment(stamp, stamp, name, media_type, data)

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Put key and value metadata inside."""
        self._mcap.add_metadata(name, dict(values))

    def flush(self, *, sync: bool) -> None:
        """Write the open chunk to disk; with `sync` also through the cache of the kernel (power loss)."""
        self._mcap.flush()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
        if sync:
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Finish the file with its index."""
        self._mcap.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def abandon(self) -> None:
        """Close the file without an index because the disk is full. `recover` completes it."""
        self._file.raw.close()


@dataclass(slots=True)
class BagWriter:
    """Writes one bag folder. Channels are opened when they are first needed."""

    folder: Path
    lookup: Lookup
    limits: BagLimits = field(default_factory=BagLimits)
    counts: Counter[str] = field(default_factory=Counter)
    stopped: str = ""
    """Reason why nothing is recorded; empty while recording."""
    free: Callable[[Path], int] = free_bytes
    _extras: list[Callable[[BagFile], None]] = field(default_factory=list)
    _done: dict[str, Contents] = field(default_factory=dict)
    _part_count: int = 0
    _part: BagFile | None = None
    _waits_for_room: bool = False
    _lock: int = -1

    @property
    def path(self) -> Path:
        """The MCAP file that is written now."""
        return self.folder / f"{self.folder.name}_{self._part_count - 1 if self._part_count else 0}.mcap"

    @property
    def size_bytes(self) -> int:
        """Bytes of all files of the bag."""
        total = self._part.size_bytes if self._part else 0
        for file in self._others():
            with suppress(FileNotFoundError):  # another process completes or drops what an earlier recorder left
                total += file.stat().st_size
        return total

    def open(self, *, resume: bool = False) -> list[Path]:
        """Create folder and file. A bag of no planned length waits for room on a full disk.

        Parameters
        ----------
        resume
            Whether a bag that is there already is gone on with.

        Returns
        -------
        list[Path]
            Files that an earlier recorder left unfinished.

        Raises
        ------
        HindraxError
            When it cannot be made, when the disk has no room for the planned length, when another recorder writes
            there, and when there is a bag already that is not to be resumed.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if self.limits.planned_s:
                self.limits.check_space(self.folder)
            self._lock = self._locked()
            if resume:
                self._part_count = self._next_number()
            if self.limits.planned_s or self._has_room():
                self._next_part()
            else:
                self._wait_for_room()
            return [file for file in self._others() if not is_whole(file)]
        except FileExistsError as error:
            raise HindraxError(
                f"{self.path} exists already; a bag is never overwritten, name another folder"
            ) from error
        except OSError as error:
            raise HindraxError(f"{self.folder}: cannot record there ({cause(error)}); check disk and rights") from error

    def attach(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside every part: the vehicle file, parameters.

        Parameters
        ----------
        name, media_type
            As MCAP has them, such as vehicle.yaml and application/yaml.
        data
            Content.
        stamp
            Its time [ns].
        """
        self._extra(lambda part: part.attach(name, media_type, data, stamp))

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Put key and value metadata inside every part: software version, mock or vehicle."""
        self._extra(lambda part: part.describe(name, values))

    def write(self, channel: Channel, data: bytes, received: int, sent: int) -> None:
        """Append one received CDR message.

        Parameters
        ----------
        channel
            Topic, type and QoS; declared where it is new.
        data
            CDR.
        received, sent
            Times [ns].
        """
        part, topic = self._part, channel.topic
        if part is None:
            return
        try:
            if not part.has(topic):
                part.open_channel(channel, definition(channel.type, self.lookup))
            part.write(topic, data, received, sent)
        except OSError as error:
            self._give_up(error)
            return
        self.counts[topic] += 1

    def flush(self, *, sync: bool = False) -> list[str]:
        """Write everything to disk, apply the limits, and return the decisions as sentences."""
        try:
            if self._part is None:
                return self._resume() if self._waits_for_room and self._has_room(ROOM_AGAIN) else []
            self._part.flush(sync=sync)
            return self._keep_limits(self._part)
        except OSError as error:
            return [self._give_up(error)]

    def close(self) -> None:
        """Finish the file with its index, and write metadata.yaml; `stopped` names a disk error."""
        try:
            self._finish()
        except OSError as error:
            self._give_up(error)
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def index(self) -> None:
        """Write metadata.yaml over all whole files of the bag."""
        write_metadata(self.folder, self._done)

    def _locked(self) -> int:
        folder = os.open(self.folder, os.O_RDONLY)
        if not try_lock(folder):
            os.close(folder)
            raise HindraxError(f"{self.folder}: another recorder writes there; end it, or name another folder")
        return folder

    def _next_number(self) -> int:
        """Number after all files of the bag; HindraxError if they belong to another bag."""
        own = re.compile(rf"{re.escape(self.folder.name)}_\d+\.mcap")
        for file in (*parts(self.folder), *self.folder.glob("*.db3")):
            if not own.fullmatch(file.name):
                found = f"found {file.name}, wanted {self.folder.name}_0.mcap and the like"
                raise HindraxError(f"{self.folder}: holds another bag ({found}); name another folder")
        return 1 + max((part_number(file)[0] for file in parts(self.folder)), default=-1)

    def _others(self) -> list[Path]:
        """Files of the bag except the current one."""
        return [file for file in parts(self.folder) if self._part is None or file != self._part.path]

    def _next_part(self) -> None:
        path = self.folder / f"{self.folder.name}_{self._part_count}.mcap"
        self._part_count += 1
        part = BagFile(path)
        for extra in self._extras:
            extra(part)
        self._part = part

    def _extra(self, put: Callable[[BagFile], None]) -> None:
        self._extras.append(put)
        if self._part is not None:
            put(self._part)

    def _keep_limits(self, part: BagFile) -> list[str]:
        decisions: list[str] = []
        contents, used = part.contents, f"the bag has used its {self.limits.budget_MB:g} MB of the disk"
        if self.limits.split_due(part.size_bytes, (contents.last - contents.first) / NS_PER_S):
            self._finish()
            self._next_part()
            decisions.append(f"{contents.name} is full; recording continues in {self.path.name}")
        while self.limits.over_budget(self.size_bytes) and self.limits.when_full == "oldest" and self._others():
            oldest = self._others()[0]
            oldest.unlink(missing_ok=True)
            self.index()
            decisions.append(f"{used}; dropped the oldest, {oldest.name}")
        if self.limits.over_budget(self.size_bytes):
            self.stopped = f"{used}; recording stopped"
            self._finish()
            decisions.append(self.stopped)
        elif not self._has_room():
            self._finish()
            decisions.append(self._wait_for_room())
        return decisions

    def _has_room(self, times: float = 1.0) -> bool:
        return self.free(self.folder) >= times * self.limits.keep_free_MB * 1e6

    def _wait_for_room(self) -> str:
        self._waits_for_room = True
        self.stopped = f"less than {self.limits.keep_free_MB:g} MB are free on the disk; recording waits for room"
        return self.stopped

    def _resume(self) -> list[str]:
        self._next_part()
        self._waits_for_room, self.stopped = False, ""
        return [f"there is room on the disk again; recording continues in {self.path.name}"]

    def _give_up(self, error: OSError) -> str:
        """Leave the file unfinished: `recover` completes it."""
        self.stopped = f"{self.path}: {cause(error)}; recording stopped, ./hindrax bag recover completes it"
        part, self._part = self._part, None
        if part is not None:
            with suppress(OSError, ValueError):
                part.abandon()
        return self.stopped

    def _finish(self) -> None:
        """Finish the file that is written now, if there is one."""
        part = self._part
        if part is not None:
            part.close()
            self._part = None
            self._done[part.path.name] = part.contents
            self.index()
