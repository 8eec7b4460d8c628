"""Notice that this process stood still: the middleware may have lost others since, or they it, for good.

Fast DDS (2.14.5, `PDP::remove_remote_participant`) takes a participant whose lease has ended out of its list first, and
only then takes away the endpoints that belong to it. A process that continues does so while another thread of it reads
the announcements that have waited. One that comes in between lists the participant again, and what is matched with it
is then taken away with the rest. Later announcements are the same one again, so they change nothing: both processes
know each other, and no message passes, until one of them begins anew (ADR 13).
"""

import threading
import time
from collections import deque
from collections.abc import Callable

LONGEST_STANDSTILL_S = 3.0
"""Less than the lease of the middleware (4 s, `loopback.xml`), by its announcements (0.25 s) and a busy machine."""
LOOK_S = 0.5
STOOD_STILL = 75
"""Exit code of a process that ends to begin anew (EX_TEMPFAIL of sysexits.h): nothing is wrong with it."""


class StandstillWatch:
    """A thread that only looks at the clock: it is late when the whole process was.

    A loop would also be late by its own work, such as a slow disk, while the threads of the middleware go on.

    Parameters
    ----------
    now_s
        Monotonic time [s].
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._standstills: deque[float] = deque()
        self._over = threading.Event()
        threading.Thread(target=self._look, name="standstill", daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._over.set()

    def _look(self) -> None:
        looked_s = self._now_s()
        while not self._over.wait(LOOK_S):
            now_s = self._now_s()
            late_s, looked_s = now_s - looked_s - LOOK_S, now_s
            if late_s > LONGEST_STANDSTILL_S:
                self._standstills.append(late_s)

    def stood_still_s(self) -> float:
        """Duration [s] of a standstill that was too long for the middleware, once; 0 where there was none."""
        return self._standstills.popleft() if self._standstills else 0.0
