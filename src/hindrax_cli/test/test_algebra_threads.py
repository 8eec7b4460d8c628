"""Threads of linear algebra: one, unless the user has another number in mind."""

import os

import pytest

from hindrax_cli import __main__ as start


@pytest.mark.parametrize(("given", "used"), [(None, "1"), ("4", "4")])
def test_one_thread_unless_the_user_has_said_how_many(
    given: str | None, used: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if given is not None:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", given)
    start._use_one_thread_for_algebra()
    assert os.environ["OPENBLAS_NUM_THREADS"] == used
