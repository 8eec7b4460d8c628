"""The checks of `hindrax test`: quiet ones speak where they fail."""

import sys
from pathlib import Path

import pytest

from hindrax_cli.commands.explain.developer import good

SPEAKS = "import sys; print('one of 10,000 lines'); sys.exit(int(sys.argv[1]))"


@pytest.mark.parametrize(("code", "told", "shown"), [(0, False, False), (2, False, True), (0, True, True)])
def test_what_a_check_says_is_kept_back_only_where_it_is_good(
    code: int, told: bool, shown: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert good("collection", [sys.executable, "-c", SPEAKS, str(code)], tmp_path, told=told) is (code == 0)
    said = capfd.readouterr().out
    assert ("one of 10,000 lines" in said) is shown
    assert f"== collection: {'good' if code == 0 else 'FAILED'}" in said
