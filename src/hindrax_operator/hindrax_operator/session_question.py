"""What a pool session asks of the person at the pool: answered in its terminal, or on the page of another process.

While it is asked, `question.json` in the folder of the session holds number and sentence, under a lock of the process
that asks: of one that has ended, no question is left. `answer.json` holds the number of the question that was answered,
so what comes late answers nothing.
"""

import fcntl
import json
import secrets
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple

from hindrax_core.text.text_file import replace_text, writing

QUESTION_FILE, ANSWER_FILE = "question.json", "answer.json"
NUMBERS = 1 << 31
LARGEST_bytes = 10_000


class Question(NamedTuple):
    """A question that somebody waits to have answered; `arms`: the answer does, so it is given in the terminal."""

    number: int
    sentence: str
    arms: bool


class SessionQuestions:
    """Questions of one session, one at a time."""

    def __init__(self, folder: Path) -> None:
        self._question, self._answer = folder / QUESTION_FILE, folder / ANSWER_FILE
        self._number = 0
        self._held: IO[str] | None = None

    def ask(self, sentence: str, *, arms: bool = False) -> None:
        """Ask, in place of the question before; HindraxError where the folder cannot be written.

        Parameters
        ----------
        sentence
            What is to be done.
        arms
            Whether the thrusters are armed when it is done: then no page answers (ADR 18).
        """
        self.close()
        self._number = 1 + secrets.randbelow(NUMBERS - 1)
        with writing(self._question):
            self._held = self._question.open("w", encoding="utf-8")
            fcntl.flock(self._held, fcntl.LOCK_EX)
            self._held.write(json.dumps(Question(self._number, sentence, arms)._asdict()))
            self._held.flush()

    def answered(self) -> bool:
        """Whether a page has answered the question that is asked."""
        return self._held is not None and _read(self._answer).get("number") == self._number

    def close(self) -> None:
        """Ask nothing any more."""
        if self._held is not None:
            self._question.unlink(missing_ok=True)
            self._answer.unlink(missing_ok=True)
            self._held.close()
            self._held = None


def asked(folder: Path) -> Question | None:
    """What the session in a folder asks now; None: nothing, or its process has ended."""
    file = folder / QUESTION_FILE
    try:
        with file.open(encoding="utf-8") as opened:
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        found = _read(file)
        number, sentence = found.get("number"), found.get("sentence")
        if isinstance(number, int) and isinstance(sentence, str):
            return Question(number, sentence, found.get("arms") is not False)
    except OSError:
        pass
    return None


def answer(folder: Path, number: int) -> bool:
    """Answer the question of a number; False where no page may, or nobody asks. HindraxError when it is not kept."""
    question = asked(folder)
    if question is None or question.number != number or question.arms:
        return False
    with writing(folder / ANSWER_FILE):
        replace_text(folder / ANSWER_FILE, json.dumps({"number": number}))
    return True


def _read(file: Path) -> dict[str, object]:
    """What a file holds; nothing where it is being written, removed, or not one of ours."""
    with suppress(OSError, ValueError), file.open(encoding="utf-8") as opened:
        found = json.loads(opened.read(LARGEST_bytes))
        if isinstance(found, dict):
            return found
    return {}
