"""Survey of a bag: topics, counts, rates, times, files; by reading it, so that unfinished bags are correct too."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from mcap.writer import MCAP0_MAGIC

from hindrax_bag.metadata import NAME, is_whole
from hindrax_bag.read.bag_reader import EVERY, PATTERNS, attachments, bag_files, messages
from hindrax_bag.read.mcap_records import Damage
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.text.yaml_text import read_yaml

SQLITE = b"SQLite format 3\x00"


@dataclass(slots=True)
class TopicSurvey:
    """One topic of a bag."""

    type: str
    count: int = 0
    bytes: int = 0


@dataclass(slots=True)
class Survey:
    """A whole bag. Times in nanoseconds of the clock that was in use."""

    bag: Path
    first: int = 0
    last: int = 0
    files: list[Path] = field(default_factory=list)
    topics: dict[str, TopicSurvey] = field(default_factory=dict)
    inside: list[str] = field(default_factory=list)
    damage: Damage = field(default_factory=Damage)

    @property
    def seconds(self) -> float:
        """From the first message to the last [s]."""
        return (self.last - self.first) / NS_PER_S

    @property
    def messages(self) -> int:
        """Total number of messages."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def size_bytes(self) -> int:
        """Size of the files."""
        return sum(file.stat().st_size for file in self.files)

    def document(self) -> dict[str, object]:
        """JSON document."""
        return {
            "bag": str(self.bag),
            "start_ns": self.first,
            "seconds": self.seconds,
            "messages": self.messages,
            "bytes": self.size_bytes,
            "files": [file.name for file in self.files],
            "finished": not self.damage.unfinished,
            "damage": self.damage.sentences,
            "attachments": self.inside,
            "topics": {
                name: {"type": one.type, "count": one.count, "bytes": one.bytes, "rate_Hz": self.rate_Hz(one)}
                for name, one in sorted(self.topics.items())
            },
        }

    def rate_Hz(self, topic: TopicSurvey) -> float:
        """Mean rate of a topic over the whole bag."""
        return round(topic.count / self.seconds, 2) if self.seconds else 0.0


def survey(bag: Path, progress: Callable[[int], None] = lambda _count: None) -> Survey:
    """Read a bag; `progress` gets the number of messages from time to time. UsageError when it is no bag."""
    found = Survey(bag, files=bag_files(bag), inside=sorted(attachments(bag)))
    for count, message in enumerate(messages(bag, damage=found.damage), 1):
        topic = found.topics.setdefault(message.topic, TopicSurvey(message.type))
        topic.count += 1
        topic.bytes += len(message.data)
        found.first = min(found.first or message.received, message.received)
        found.last = max(found.last, message.received)
        if count % EVERY == 0:
            progress(count)
    return found


@dataclass(frozen=True, slots=True)
class ListedBag:
    """A bag in a list, from its metadata.yaml; without one, from its files."""

    bag: Path
    bytes: int
    finished: bool
    seconds: float = 0.0
    messages: int = 0
    note: str = ""
    """Text instead of length and messages."""

    def document(self) -> dict[str, object]:
        """JSON document."""
        return asdict(self) | {"bag": str(self.bag)}


def find_bags(folder: Path) -> list[ListedBag]:
    """Bags in a folder and all folders below it, by name; UsageError when it is no folder."""
    if not folder.is_dir():
        raise UsageError(f"{folder}: is no folder; name one that holds bags or runs")
    places = {file.parent for pattern in PATTERNS for file in folder.rglob(pattern)}
    return [_listed(place) for place in sorted(places)]


def _listed(bag: Path) -> ListedBag:
    files = bag_files(bag)
    size = sum(file.stat().st_size for file in files)
    try:
        data = read_yaml((bag / NAME).read_text(encoding="utf-8"), NAME)["rosbag2_bagfile_information"]
        listed = {Path(name).name for name in data["relative_file_paths"]}
        if any(file.name not in listed for file in files):
            return ListedBag(bag, size, finished=False, note="unfinished: bag recover")
        seconds = data["duration"]["nanoseconds"] / NS_PER_S
        return ListedBag(bag, size, finished=True, seconds=seconds, messages=int(data["message_count"]))
    except (OSError, UsageError, UnicodeDecodeError, KeyError, TypeError):
        whole, note = _looks(files[-1])
        return ListedBag(bag, size, whole, note=note)


def _looks(file: Path) -> tuple[bool, str]:
    """Whether a file is complete, by its first and last bytes, and a remark about it."""
    with file.open("rb") as stream:
        head = stream.read(len(SQLITE))
    if head == SQLITE or (head.startswith(MCAP0_MAGIC) and is_whole(file)):
        return True, f"no {NAME}: bag info reads it"
    if MCAP0_MAGIC.startswith(head[: len(MCAP0_MAGIC)]):
        return False, "unfinished: bag recover"
    return False, f"{file.name} is no bag"
