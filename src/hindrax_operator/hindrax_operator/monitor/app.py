"""The full-screen view: places for the sections, a snapshot five times a second, and three keys."""

from typing import ClassVar

from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.events import Resize
from textual.widgets import Footer, Static

from hindrax_core.errors import INTERRUPTED
from hindrax_operator.monitor import draw
from hindrax_operator.monitor.graph_link import GraphLink

REFRESH_S = 0.2
FRAMED = ("state", "thrusters", "holds", "health", "maneuver")
TWO_COLUMNS = 78
"""Narrower than this, the sections stand below each other."""


class Monitor(App[int]):
    """The view of one vehicle."""

    TITLE = "hindrax"
    ENABLE_COMMAND_PALETTE = False
    AUTO_FOCUS = None  # it would scroll to the last section, and what is armed away from a small screen
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("s", "end('stop', 'stopping')", "STOP (disarm, cancel)", priority=True),
        Binding("d", "end('disarm', 'disarming')", "disarm"),
        Binding("q", "quit", "quit (ROV stays up)"),
        Binding("ctrl+c", "interrupt", show=False, priority=True),
        Binding("down,pagedown", "scroll(1)", show=False),
        Binding("up,pageup", "scroll(-1)", show=False),
    ]
    CSS_PATH = "app.tcss"

    def __init__(self, vehicle: GraphLink) -> None:
        super().__init__()
        self._vehicle = vehicle
        # Kept, not looked up: a snapshot may still arrive while the screen is being taken down.
        self._places = {name: Static(id=name, classes="section") for name in FRAMED}
        self._places |= {name: Static(id=name) for name in ("headline", "estimates")}

    def compose(self) -> ComposeResult:
        """Lay out: what moves on top, who is well below, the maneuver and what it teaches at the bottom."""
        places = self._places
        yield places["headline"]
        with Horizontal(classes="row"):
            yield places["state"]
            yield places["thrusters"]
        with Horizontal(classes="row"):
            yield places["holds"]
            yield places["health"]
        yield places["maneuver"]
        with VerticalScroll(id="rest") as rest:
            rest.border_title = "estimate, noise so far; ± half of the 68 % interval; SI"
            yield places["estimates"]
        yield Footer()

    def on_mount(self) -> None:
        """Name the sections and begin."""
        for name, place in self._places.items():
            if place.has_class("section"):
                place.border_title = name
        self.set_interval(REFRESH_S, self.refresh_snapshot)
        self.refresh_snapshot()

    def on_resize(self, event: Resize) -> None:
        """Two columns where there is room for them."""
        self.screen.set_class(event.size.width < TWO_COLUMNS, "narrow")

    def refresh_snapshot(self) -> None:
        """Draw what is known now."""
        view = self._vehicle.snapshot()
        places = self._places
        for screen in self.screen_stack[-1:]:  # none while it is being taken down
            screen.set_class(view.silent_s > draw.SILENT_S, "old")
        places["headline"].update(draw.headline(view, self._vehicle.title))
        for name, section in draw.SECTIONS.items():
            places[name].update(section(view))
        places["thrusters"].border_title = f"thrusters{draw.lost(view.thrusters)}"

    def action_scroll(self, way: int) -> None:
        """Scroll the list of estimates, and on a small screen the sections."""
        for one in (self.query_one("#rest"), self.screen):
            one.scroll_relative(y=4 * way, animate=False)

    def action_interrupt(self) -> None:
        """End as every command does on Ctrl-C."""
        self.exit(INTERRUPTED)

    def action_end(self, how: str, doing: str) -> None:
        """Stop or disarm now; no question is asked."""
        self.notify(doing, timeout=2)
        self._vehicle.end(how, self._show_outcome)

    def _show_outcome(self, sentence: str, went_well: bool) -> None:
        """Show an outcome; called from the thread that has it."""
        self.call_from_thread(
            self.notify, sentence, severity="information" if went_well else "error", timeout=3 if went_well else 15
        )
