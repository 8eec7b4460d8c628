"""A sentence that knows its code."""

import copy
from enum import StrEnum

import pytest

from hindrax_core.text.coded import Coded, coded


class Why(StrEnum):
    NONE = ""
    LATE = "late"


SENTENCES = {Why.NONE: "", Why.LATE: "{age_s:.1f} s old"}


def test_it_is_its_sentence_and_its_code() -> None:
    late = coded(SENTENCES, Why.LATE, age_s=2.34)
    assert (late, late.code, bool(late)) == ("2.3 s old", Why.LATE, True)
    assert not coded(SENTENCES, Why.NONE)
    with pytest.raises(KeyError, match="age_s"):
        coded(SENTENCES, Why.LATE)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_has_the_code_too(copied: object) -> None:
    assert callable(copied)
    made: Coded[Why] = copied(coded(SENTENCES, Why.LATE, age_s=1.0))
    assert (made, made.code) == ("1.0 s old", Why.LATE)
