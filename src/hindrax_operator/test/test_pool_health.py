"""A pool test in the eyes of `hindrax health`: what it flies, whether it is armed, what its nodes complain of."""

from __future__ import annotations

import time
import types
from pathlib import Path
from types import SimpleNamespace

import pytest

from hindrax_bringup.liveness import felt, pulse
from hindrax_bringup.stack_lock import FOLDER
from hindrax_operator.pool_run import Beating

OK, ERROR = b"\x00", b"\x02"


@pytest.mark.parametrize(
    ("level", "thrusters", "found"),
    [
        (OK, None, (True, "pool-test surge: starting")),
        (OK, SimpleNamespace(state="armed"), (True, "pool-test surge: armed")),
        (ERROR, SimpleNamespace(state="armed"), (False, "dvl75: no bottom lock: too deep")),
    ],
)
def test_a_pool_test_is_felt(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    level: bytes,
    thrusters: types.SimpleNamespace | None,
    found: tuple[bool, str],
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    one = SimpleNamespace(level=level, message="no bottom lock: too deep")
    operator = SimpleNamespace(thrusters=thrusters, diagnostics={"hindrax: dvl75": one})
    with pulse() as beating:
        Beating(beating, "pool-test surge").beat(operator)
        assert felt(tmp_path, time.monotonic()) == found
