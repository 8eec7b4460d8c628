"""Build, boot, deploy, harm: one line per check, 0 when all are good, 1 when one is not, 2 for wrong use."""

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_core.errors import HindraxError
from hindrax_tools.virtual_vehicle.checks import CHECKS, DeployedVehicle, Finding, deployment
from hindrax_tools.virtual_vehicle.image import image_of, missing_packages
from hindrax_tools.virtual_vehicle.machine import Machine


def main() -> int:
    """Run the checks, print each finding as it comes."""
    made = argparse.ArgumentParser(prog="python -m hindrax_tools.virtual_vehicle", description=__doc__)
    made.add_argument("cache", type=Path, metavar="DIR", help="where images are kept, 2 GB each")
    made.add_argument("--only", nargs="+", choices=CHECKS, default=list(CHECKS), help="checks after the deployment")
    made.add_argument("--cuts", type=int, default=8, help="number of power cuts; default 8")
    made.add_argument("--seed", type=int, default=1, help="of the times of the power cuts; default 1")
    made.add_argument(
        "--kernel", type=Path, help="User-mode Linux of your own, for what Debian's lacks: see tools/README.md"
    )
    words = made.parse_args()
    began = time.monotonic()

    def report(sentence: str) -> None:
        print(f"[{time.monotonic() - began:5.0f} s] {sentence}", file=sys.stderr, flush=True)

    if missing := missing_packages():
        report(f"found no programs of {len(missing)} Debian packages; sudo apt install {' '.join(missing)}")
        return HindraxError.exit_code
    bad = skipped = 0
    try:
        clone = clone_root()
        image = image_of(clone, words.cache, report)
        if words.kernel is not None:
            image = replace(image, kernel=words.kernel.resolve())
        with tempfile.TemporaryDirectory(prefix="virtual-vehicle-") as folder, Machine(image, Path(folder)) as machine:
            for finding in findings(DeployedVehicle(machine, clone, words.cuts, words.seed), words.only):
                report(finding.line())
                bad += finding.good is False
                skipped += finding.good is None
    except HindraxError as error:
        report(str(error))
        return error.exit_code
    left_out = f", {skipped} not run" if skipped else ""
    report(("all good" if not bad else f"{bad} bad") + left_out)
    return 1 if bad else 0


def findings(vehicle: DeployedVehicle, names: list[str]) -> Iterator[Finding]:
    """Findings of the deployment and the checks of these names; a check that ends early is a bad finding."""
    yield from deployment(vehicle)
    for name in [one for one in CHECKS if one in names]:
        try:
            yield from CHECKS[name](vehicle)
        except HindraxError as error:
            yield Finding(name, good=False, figure=str(error))


if __name__ == "__main__":
    sys.exit(main())
