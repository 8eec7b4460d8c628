"""The word for a vehicle file in a command that is printed to be copied."""

from pathlib import Path

import pytest

from hindrax_bringup.share_files import vehicle_file, vehicle_word


def test_a_file_that_its_name_finds_is_called_by_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert vehicle_word(vehicle_file("bluerov2-heavy")) == "bluerov2-heavy"
    own = tmp_path / "lbv.yaml"
    own.touch()
    assert vehicle_word(own) == str(own), "another file has that name"
    monkeypatch.chdir(tmp_path)
    assert vehicle_word(own) == "lbv"
    assert vehicle_word(tmp_path / "nobody.yaml") == str(tmp_path / "nobody.yaml")
