"""Reasons of the thruster output: a code for programs, a sentence for people, also where the sentence came alone."""

import pytest

from hindrax_drivers.output.output_reasons import (
    NEW,
    NO_REASON,
    SENTENCES,
    OutputReason,
    all_of,
    from_sentence,
    output_reason,
)

SAMPLES: dict[OutputReason, tuple[dict[str, object], str]] = {
    OutputReason.STARTED_AGAIN: ({"ended": "it died"}, "not armed since it died and was started again"),
    OutputReason.SILENCE: ({"silent_s": 5.0}, "no command for 5 s"),
    OutputReason.DISOBEYED: ({"silent_s": 5.0, "refused": "R"}, "no command obeyed for 5 s: R"),
    OutputReason.CLOCK: ({"back_s": 3600.0}, "the clock went back by 3.6e+03 s"),
    OutputReason.RESTORED: ({"fault": "bus is stuck"}, "output is back after: bus is stuck"),
    OutputReason.DEAD_MAN: ({"what": "has died"}, "the dead man has died"),
    OutputReason.UNOBEYED: ({"refused": "found 2"}, "no command is obeyed: found 2"),
}


def test_every_code_has_its_sentence() -> None:
    assert set(SENTENCES) == set(OutputReason)
    assert not NO_REASON
    assert {code: output_reason(code, **numbers) for code, (numbers, _) in SAMPLES.items()} == {
        code: sentence for code, (_, sentence) in SAMPLES.items()
    }


@pytest.mark.parametrize(
    "code", [one for one in OutputReason if SENTENCES[one].partition("{")[0] or not SENTENCES[one]]
)
def test_a_sentence_that_came_alone_finds_its_code(code: OutputReason) -> None:
    numbers = SAMPLES[code][0] if code in SAMPLES else {}
    assert from_sentence(str(output_reason(code, **numbers))).code is code


@pytest.mark.parametrize("code", [OutputReason.UNNAMED, OutputReason.DEVICE, OutputReason.LIFECYCLE])
def test_words_of_somebody_else_have_no_code_of_ours(code: OutputReason) -> None:
    words = dict.fromkeys(("sentence", "found", "state"), "bus is stuck")
    assert from_sentence(str(output_reason(code, **words))).code is OutputReason.UNNAMED


def test_of_several_reasons_all_are_told_and_the_first_is_the_code() -> None:
    dead_man = output_reason(OutputReason.DEAD_MAN, what="does not answer")
    both = all_of({"dead man": dead_man, "lifecycle": NO_REASON, "other": NEW})
    assert (both.code, both) == (OutputReason.DEAD_MAN, f"{dead_man}; {NEW}")
    assert all_of({"dead man": NO_REASON}) is NO_REASON
