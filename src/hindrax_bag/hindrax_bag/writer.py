"""A bag on disk: a folder of MCAP files with the ROS 2 profile and, beside them, the metadata.yaml of rosbag2.

The caller flushes it at least every second of wall time, so that a power cut costs no more. Splitting, the budget of
the disk and what is done when it is used up are decided at a flush; each decision is said as a sentence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from hindrax_bag.definitions import Lookup, definition, share_lookup
from hindrax_bag.limits import Limits, free_bytes
from hindrax_bag.metadata import NAME, Channel, Contents, metadata_text
from hindrax_bag.part import Part
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S

__all__ = ["BagWriter", "Channel"]


@dataclass(slots=True)
class BagWriter:
    """Writes one bag folder. Channels are opened when they are first needed."""

    folder: Path
    lookup: Lookup = share_lookup
    limits: Limits = field(default_factory=Limits)
    counts: Counter[str] = field(default_factory=Counter)
    stopped: str = ""
    """Why nothing is recorded any more; empty while recording."""
    free: Callable[[Path], int] = free_bytes
    _channels: dict[str, Channel] = field(default_factory=dict)
    _definitions: dict[str, str] = field(default_factory=dict)
    _extras: list[Callable[[Part], None]] = field(default_factory=list)
    _done: list[tuple[Contents, int]] = field(default_factory=list)
    _begun: int = 0
    _part: Part | None = None

    @property
    def path(self) -> Path:
        """The MCAP file that is written now."""
        return self.folder / f"{self.folder.name}_{self._begun - 1 if self._begun else 0}.mcap"

    @property
    def size_bytes(self) -> int:
        """Bytes of all files of the bag."""
        return sum(size for _, size in self._done) + (self._part.size_bytes if self._part else 0)

    def open(self) -> None:
        """Make folder and file; HindraxError when it exists, cannot be made, or the disk has no room."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.limits.check_space(self.folder)
            self._next_part()
        except FileExistsError as error:
            raise HindraxError(
                f"{self.path} exists already; a bag is never overwritten, name another folder"
            ) from error
        except OSError as error:
            raise HindraxError(
                f"{self.folder}: cannot record there ({error.strerror}); check disk and rights"
            ) from error

    def attach(self, name: str, media_type: str, data: bytes, stamp: int) -> None:
        """Put a file inside every part: the vehicle file, parameters."""
        self._extra(lambda part: part.attach(name, media_type, data, stamp))

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Put key and value metadata inside every part: software version, mock or vehicle."""
        self._extra(lambda part: part.describe(name, values))

    def write(self, channel: Channel, data: bytes, received: int, sent: int) -> None:
        """Append one message as it came off the wire (CDR), with the time of receipt and of sending [ns]."""
        part, topic = self._part, channel.topic
        if part is None:
            return
        try:
            if not part.has(topic):
                self._open_channel(part, channel)
            part.write(topic, data, received, sent)
        except OSError as error:
            self._give_up(error)
            return
        self.counts[topic] += 1

    def flush(self, *, sync: bool = False) -> list[str]:
        """Bring everything to the disk, keep the limits, and return what was decided, as sentences."""
        if self._part is None:
            return []
        try:
            self._part.flush(sync=sync)
            return self._keep_limits(self._part)
        except OSError as error:
            return [self._give_up(error)]

    def close(self) -> None:
        """Finish the file with its index, and write metadata.yaml."""
        if self._part is not None:
            self._finish(self._part)

    def _next_part(self) -> None:
        path = self.folder / f"{self.folder.name}_{self._begun}.mcap"
        self._begun += 1
        part = Part(path)
        for extra in self._extras:
            extra(part)
        self._part = part

    def _extra(self, put: Callable[[Part], None]) -> None:
        assert self._part is not None
        self._extras.append(put)
        put(self._part)

    def _open_channel(self, part: Part, channel: Channel) -> None:
        if channel.type not in self._definitions:
            self._definitions[channel.type] = definition(channel.type, self.lookup)
        part.open_channel(channel, self._definitions[channel.type])
        self._channels[channel.topic] = channel

    def _keep_limits(self, part: Part) -> list[str]:
        said: list[str] = []
        contents = part.contents
        if self.limits.split_due(part.size_bytes, (contents.last - contents.first) / NS_PER_S):
            self._finish(part)
            self._next_part()
            said.append(f"{contents.name} is full; {self.path.name} goes on")
        while self.limits.over_budget(self.size_bytes) and self.limits.when_full == "oldest" and self._done:
            said.append(self._drop_oldest())
        if self.limits.over_budget(self.size_bytes):
            said.append(self._stop(f"the bag has used its {self.limits.budget_MB:g} MB of the disk"))
        elif self.free(self.folder) < self.limits.keep_free_MB * 1e6:
            said.append(self._stop(f"less than {self.limits.keep_free_MB:g} MB are free on the disk"))
        return said

    def _drop_oldest(self) -> str:
        contents, _ = self._done.pop(0)
        (self.folder / contents.name).unlink(missing_ok=True)
        self._write_metadata()
        return f"the bag has used its {self.limits.budget_MB:g} MB of the disk; dropped the oldest, {contents.name}"

    def _stop(self, why: str) -> str:
        self.stopped = f"{why}; recording stopped"
        if self._part is not None:
            self._finish(self._part)
        return self.stopped

    def _give_up(self, error: OSError) -> str:
        """Leave the file as it is: `recover` makes a whole bag of it."""
        self.stopped = f"{self.path}: {error.strerror or error}; recording stopped, ./hindrax bag recover completes it"
        part, self._part = self._part, None
        if part is not None:
            with suppress(OSError, ValueError):
                part.abandon()
        return self.stopped

    def _finish(self, part: Part) -> None:
        part.close()
        self._part = None
        self._done.append((part.contents, part.path.stat().st_size))
        self._write_metadata()

    def _write_metadata(self) -> None:
        text = metadata_text(self._channels.values(), [contents for contents, _ in self._done])
        (self.folder / NAME).write_text(text, encoding="utf-8")
