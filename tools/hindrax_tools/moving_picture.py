"""A moving picture of a command in a terminal, as an SVG that plays by itself: recorded from a real run.

`python -m hindrax_tools.moving_picture docs/images/pool-test.svg` flies the mock and writes that of the README.
"""

import fcntl
import itertools
import os
import pty
import re
import shutil
import struct
import sys
import termios
import time
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from hindrax_core.text.text_file import replace_text

WIDE, TALL = 80, 24
CHARACTER_px, LINE_px, MARGIN_px = 7.83, 17, 14
PLAYED_S, HELD_S = 12.0, 6.0
"""Time in which a run is played however long it took, and the time for which its end is held."""
SHORTEST_S = 0.08
"""Between two lines."""
ESCAPE = re.compile(rb"\x1b(\[[0-9;?]*[A-Za-z]|\][^\x07]*\x07)")
SPINNER = re.compile("[\u2800-\u28ff]")
FONTS = "ui-monospace,SFMono-Regular,Menlo,Consolas,'DejaVu Sans Mono',monospace"
GROUND, INK, PROMPT = "#12171d", "#e8edf2", "#5fc3df"
COMMAND = ("pool-test", "--mock", "--headless")


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the terminal and when it was complete, in seconds since the start."""

    at_s: float
    text: str


def recorded(words: Sequence[str], folder: Path) -> list[Line]:
    """Run a command in a terminal of its own and keep its lines, without colors and without the path of the folder."""
    child, terminal = pty.fork()
    if child == 0:
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", TALL, WIDE, 0, 0))
        os.chdir(folder)
        os.execvp(words[0], list(words))  # noqa: S606  # our own command
    begin, rest, lines = time.monotonic(), b"", []
    while True:
        try:
            read = os.read(terminal, 1 << 16)
        except OSError:  # a terminal whose program has ended
            break
        if not read:
            break
        *whole, rest = (rest + read).split(b"\n")
        at_s = time.monotonic() - begin
        texts = [_text(one).replace(f"{folder}/", "") for one in whole]
        lines += [Line(at_s, text) for text in texts if not SPINNER.search(text)]
    os.close(terminal)
    os.waitpid(child, 0)
    return lines


def _text(line: bytes) -> str:
    return ESCAPE.sub(b"", line).decode().strip("\r").rstrip()


def animated(command: str, lines: Sequence[Line]) -> str:
    """SVG of a terminal in which the lines come one after the other; it scrolls, and begins anew."""
    shown = [Line(0.0, f"$ {command}"), *lines]
    times = _played([one.at_s for one in shown])
    whole_s = times[-1] + HELD_S
    width, height = round(WIDE * CHARACTER_px + 2 * MARGIN_px), TALL * LINE_px + 2 * MARGIN_px
    rules, texts, scroll = [], [], ["0%{transform:translateY(0)}"]
    for number, (one, at_s) in enumerate(zip(shown, times, strict=True)):
        part = 100.0 * at_s / whole_s
        if number:
            rules.append(f"@keyframes l{number}{{0%,{part:.2f}%{{opacity:0}}{part + 0.01:.2f}%,100%{{opacity:1}}}}")
        if number >= TALL:
            scroll.append(f"{part:.2f}%{{transform:translateY({-LINE_px * (number - TALL + 1)}px)}}")
        style = f' style="animation-name:l{number}"' if number else f' fill="{PROMPT}"'
        place = f'x="{MARGIN_px}" y="{MARGIN_px + LINE_px * (number + 0.8):.1f}"'
        texts.append(f"<text {place}{style}>{escape(one.text)}</text>")
    rules.append(f"@keyframes scroll{{{''.join(scroll)}100%{{transform:translateY({_end(len(shown))}px)}}}}")
    end = f"transform:translateY({_end(len(shown))}px)"
    # Who wants no motion sees the end.
    still = f"@media(prefers-reduced-motion:reduce){{*{{animation:none!important}}.s{{{end}}}}}"
    look = (
        f"text{{font:13px {FONTS};fill:{INK};white-space:pre;animation:{whole_s:.1f}s linear infinite}}"
        f".s{{animation:scroll {whole_s:.1f}s step-end infinite}}"
    )
    box = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {box} role="img">'
        f"<title>{escape(command)}</title><style>{look}{''.join(rules)}{still}</style>"
        f'<clipPath id="c"><rect y="{MARGIN_px}" width="{width}" height="{TALL * LINE_px}"/></clipPath>'
        f'<rect width="{width}" height="{height}" rx="8" fill="{GROUND}"/>'
        f'<g clip-path="url(#c)"><g class="s">{"".join(texts)}</g></g></svg>\n'
    )


def _end(count: int) -> int:
    return -LINE_px * max(0, count - TALL)


def _played(times: Sequence[float]) -> list[float]:
    """Times compressed to the time of playing, with a least distance between lines."""
    pace = PLAYED_S / max(times[-1], PLAYED_S)
    out = [0.6]
    for before, now in itertools.pairwise(times):
        out.append(out[-1] + max(SHORTEST_S, pace * (now - before)))
    return out


def main() -> int:
    """Record the picture of the README."""
    tool = shutil.which("hindrax") or "hindrax"
    lines = recorded([tool, *COMMAND], Path.cwd())
    replace_text(Path(sys.argv[1]), animated(f"./hindrax {' '.join(COMMAND[:2])}", lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
