"""The bus as a file is an extra: the mock starts without it, and says so only where the file is wanted."""

import sys
from pathlib import Path

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions
from hindrax_cli.commands.machine.mock import serve
from hindrax_core.errors import HindraxError


def test_a_mock_without_the_extra_serves_all_but_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hindrax_i2c_file.fuse_i2c", None)
    seen: list[object] = []
    serve(default_vehicle(), MockOptions(), seen.append, lambda: bool(seen), place=tmp_path / "ports")
    assert len(seen) == 1
    with pytest.raises(HindraxError, match="found no package hindrax_i2c_file, wanted this extra"):
        serve(default_vehicle(), MockOptions(), seen.append, lambda: True, place=tmp_path / "ports", i2c_device="/i2c")
