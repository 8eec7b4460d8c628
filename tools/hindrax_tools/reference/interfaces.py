"""Pages of the interfaces: topics from their table; our own messages, services and actions from their definitions."""

from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_core.topics import TOPICS, Quality, Topic, resolved
from hindrax_tools.reference.markdown import code, head, number, table

TOPICS_ABOUT = """Every topic of the stack. Only the vehicle's own machine sees them unless a tether is named. Recorded
ones are in every bag. A rate of 0 means: on change."""
MESSAGES = """Interfaces of `hindrax_msgs`. Where a standard message serves, it is used instead (see
[topics](topics.md)). Every field says its unit; `-` has none."""
FOLDERS = {"msg": ("",), "srv": ("request", "response"), "action": ("goal", "result", "feedback")}


def messages_page() -> str:
    """Page of the messages."""
    root = clone_root() / "src" / "hindrax_msgs"
    files = [file for folder in FOLDERS for file in sorted((root / folder).iterdir())]
    return head("Messages, services, actions", MESSAGES) + "".join(map(_interface, files))


def _interface(file: Path) -> str:
    about, parts = _read(file)
    tables = [
        (f"\n{title}:\n" if title else "") + "\n" + table(("type", "field", "unit", "meaning"), part)
        for title, part in zip(FOLDERS[file.parent.name], parts, strict=True)
    ]
    return f"\n## hindrax_msgs/{file.parent.name}/{file.stem}\n\n{about}\n" + "".join(tables)


def _read(file: Path) -> tuple[str, list[list[tuple[str, ...]]]]:
    """Comment at the top of a definition, and the fields of each of its parts."""
    about: list[str] = []
    parts: list[list[tuple[str, ...]]] = [[]]
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            about.append(line.removeprefix("#").strip())
        elif line.startswith("---"):
            parts.append([])
        elif line.strip():
            parts[-1].append(_field(line))
    return " ".join(about), parts


def _field(line: str) -> tuple[str, ...]:
    """Type, name, unit and meaning of one line; constants have no unit."""
    declaration, _, comment = line.partition("#")
    kind, _, name = declaration.strip().partition(" ")
    meaning, unit = comment.strip(), ""
    if meaning.endswith("]"):
        meaning, _, unit = meaning[:-1].rpartition("[")
    return code(kind), code(name.strip()), unit, meaning.strip()


def topics_page() -> str:
    """Page of the topics."""
    columns = ("topic", "type", "rate [Hz]", "quality", "recorded", "meaning")
    return f"{head('Topics', TOPICS_ABOUT)}\n{table(columns, map(_topic, TOPICS))}"


def _topic(topic: Topic) -> tuple[str, ...]:
    name, kind, quality = code(resolved(topic)), code(topic.type), _quality(topic.quality)
    return name, kind, number(topic.rate_Hz), quality, "yes" if topic.recorded else "no", topic.meaning


def _quality(quality: Quality) -> str:
    words = ["reliable" if quality.reliable else "best effort", f"depth {quality.depth}"]
    words += ["latched"] if quality.latched else []
    words += [f"deadline {quality.deadline_s:g} s"] if quality.deadline_s else []
    words += [f"lifespan {quality.lifespan_s:g} s"] if quality.lifespan_s else []
    return ", ".join(words)
