"""Serial emulators on ptys at stable paths, which other programs open like a serial port."""

from __future__ import annotations

import os
import pty
import termios
import tty
from pathlib import Path

READ_AT_MOST = 65536


class Pty:
    """A pty whose far end is linked at `path`. Bytes that nobody reads are lost, as on a wire."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._ends: tuple[int, int] | None = None
        self.plug(in_place=True)

    def plug(self, *, in_place: bool) -> None:
        """Plug in, or unplug: programs at the far end then lose their port."""
        if in_place and self._ends is None:
            near, far = pty.openpty()
            tty.setraw(far)
            os.set_blocking(near, False)
            self._ends = (near, far)
            self.path.unlink(missing_ok=True)
            self.path.symlink_to(os.ttyname(far))
        elif not in_place and self._ends is not None:
            self.path.unlink(missing_ok=True)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def write(self, data: bytes) -> None:
        """Send bytes to the far end. A full buffer was not read for seconds: its content is discarded.

        So the next program that opens the port starts with current data, as on a real port.
        """
        if self._ends is None:
            return
        near, far = self._ends
        try:
            os.write(near, data)
        except BlockingIOError:
            termios.tcflush(far, termios.TCIFLUSH)

    def read(self) -> bytes:
        """Return bytes from the far end."""
        if self._ends is None:
            return b""
        try:
            return os.read(self._ends[0], READ_AT_MOST)
        except OSError:
            return b""

    def close(self) -> None:
        """Unplug permanently."""
        self.plug(in_place=False)
