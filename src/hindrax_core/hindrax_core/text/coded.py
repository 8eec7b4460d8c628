"""A sentence for people that knows its code for programs: the form of every reason that is not a text alone.

Each theme has an enum of codes and one table of sentences beside it (`refusals`, `objections`, the checks of a state,
the reasons of the thruster output, of an interview, of a sample). A test compares a sentence once, the code otherwise.
"""

from collections.abc import Mapping
from enum import Enum
from typing import Generic, Self, TypeVar

CodeT = TypeVar("CodeT", bound=Enum)


class Coded(str, Generic[CodeT]):
    """A `str`, so that whatever prints, records or publishes it goes on to do so; what decides reads `code`."""

    __slots__ = ("code",)
    code: CodeT

    def __new__(cls, code: CodeT, sentence: str) -> Self:
        """Make the sentence of a code; `coded` takes it from a table."""
        made = super().__new__(cls, sentence)
        made.code = code
        return made

    def __getnewargs__(self) -> tuple[CodeT, str]:  # type: ignore[override]  # what makes a copy of it
        return self.code, str(self)


def coded(sentences: Mapping[CodeT, str], code: CodeT, /, **numbers: object) -> Coded[CodeT]:
    """Fill the sentence of a code.

    Parameters
    ----------
    sentences
        The table of its theme, with the fields of each sentence in braces.
    code
        Key of the table.
    **numbers
        Values of the fields; KeyError without one.

    Returns
    -------
    Coded[CodeT]
        False, as any empty text, where the sentence of the code is empty.
    """
    return Coded(code, sentences[code].format_map(numbers))
