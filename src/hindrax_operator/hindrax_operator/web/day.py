"""The pool session of the day for the page: steps, what they reached, what it asks of the person at the pool."""

import time
from collections.abc import Mapping
from pathlib import Path

from hindrax_analysis.identification.pool_session import SESSION_FILE, PoolSession, drag_goal, load
from hindrax_analysis.next_step import quoted_share
from hindrax_core.errors import HindraxError
from hindrax_core.events import NS_PER_S
from hindrax_operator.session_question import answer, asked

LOOK_S = 1.0
"""Time between two looks at the folder of runs."""
SHOWN_S = 6 * 3600.0
"""Age of the last step up to which a session is that of the day."""


class SessionOfTheDay:
    """The session that was last kept below one folder of runs; its methods may be called from any thread."""

    def __init__(self, runs: Path) -> None:
        self._runs = runs
        self._looked_s = float("-inf")
        self._kept: tuple[int, Path] | None = None
        self._session: PoolSession | None = None
        self._shown: Mapping[str, object] | None = None

    def shown(self) -> Mapping[str, object] | None:
        """What the page shows of it; None where there is none.

        Returns
        -------
        Mapping[str, object] | None
            `name`; `steps`, each with `name`, `state` (done, next or left) and `remark`; `reached`, a row for each
            motion: its name, the deviation of the drag, and the goal; `question`, with `number`,
            `sentence` and `arms`, or None.
        """
        if time.monotonic() - self._looked_s >= LOOK_S:
            self._look()
            self._looked_s = time.monotonic()
        return self._shown

    def answer(self, number: int) -> bool:
        """Answer the question of a number; False where no page may, or nobody asks it any more."""
        self._looked_s = float("-inf")
        self.shown()
        return self._kept is not None and answer(self._kept[1].parent, number)

    def _look(self) -> None:
        """Read the newest session again where it was kept since, and what it asks."""
        newest = self._newest()
        if newest != self._kept:
            self._kept, self._session = newest, None if newest is None else _read(newest[1].parent)
        self._shown = None
        if newest is not None and self._session is not None:
            self._shown = _shown(newest[1].parent, self._session)

    def _newest(self) -> tuple[int, Path] | None:
        """When the newest was kept [ns], and its file."""
        try:
            inside = self._runs.resolve(strict=True)
            # A link out of the folder of runs is not followed.
            files = [file for file in inside.glob(f"*/{SESSION_FILE}") if file.resolve() == file]
            newest = max((file.stat().st_mtime_ns, file) for file in files)
        except (OSError, ValueError):  # no runs yet, none of a session, or one that is being removed
            return None
        return newest if time.time() - newest[0] / NS_PER_S < SHOWN_S else None


def _read(folder: Path) -> PoolSession | None:
    try:
        return load(folder)
    except HindraxError:  # damaged, or of another version: its own command says so
        return None


def _shown(folder: Path, session: PoolSession) -> Mapping[str, object]:
    question = asked(folder)
    return {
        "name": folder.name,
        "steps": _steps(session),
        "reached": [
            (motion, quoted_share(one.drag), f"{drag_goal(motion):.0%}") for motion, one in session.reached.items()
        ],
        "question": None if question is None else question._asdict(),
    }


def _steps(session: PoolSession) -> list[Mapping[str, str]]:
    done = [{"name": step.name, "state": "done", "remark": step.remark} for step in session.done]
    left = [{"name": name, "state": "left", "remark": ""} for name in session.left]
    return [*done, *({**one, "state": "next"} for one in left[:1]), *left[1:]]
