"""Page of the topics, from their table."""

from __future__ import annotations

from hindrax_core.topics import TOPICS, Quality, Topic, resolved
from hindrax_tools.reference.markdown import code, head, number, table

ABOUT = """Every topic of the stack. Only the vehicle's own machine sees them unless a tether is named. Recorded
ones are in every bag. A rate of 0 means: on change."""


def page() -> str:
    """Return the page."""
    columns = ("topic", "type", "rate [Hz]", "quality", "recorded", "meaning")
    return f"{head('Topics', ABOUT)}\n{table(columns, map(_cells, TOPICS))}"


def _cells(topic: Topic) -> tuple[str, ...]:
    recorded = "yes" if topic.recorded else "no"
    return (
        code(resolved(topic)),
        code(topic.type),
        number(topic.rate_Hz),
        _quality(topic.quality),
        recorded,
        topic.meaning,
    )


def _quality(quality: Quality) -> str:
    words = ["reliable" if quality.reliable else "best effort", f"depth {quality.depth}"]
    words += ["latched"] if quality.latched else []
    words += [f"deadline {quality.deadline_s:g} s"] if quality.deadline_s else []
    words += [f"lifespan {quality.lifespan_s:g} s"] if quality.lifespan_s else []
    return ", ".join(words)
