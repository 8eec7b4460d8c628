"""Files that come with the stack: vehicles, middleware profiles."""

import os
from pathlib import Path

import yaml

from hindrax_core.errors import UsageError
from hindrax_core.knobs import build
from hindrax_core.text.nearest import did_you_mean
from hindrax_core.vehicle import Vehicle

VEHICLE = "HINDRAX_VEHICLE"
"""Environment variable with the vehicle, by name or file, that is meant where none is named."""


def share_folder(name: str) -> Path:
    """Folder of the package: in the source tree, within the package (the wheel), or else in its share folder."""
    here = Path(__file__).resolve().parent
    for folder in (here.parent / name, here / name):
        if folder.is_dir():
            return folder
    from ament_index_python.packages import get_package_share_directory  # noqa: PLC0415  # exists only under ROS

    return Path(get_package_share_directory("hindrax_bringup")) / name


def default_vehicle() -> Path:
    """Return the file of the Hindrax itself."""
    return share_folder("vehicles") / "hindrax.yaml"


def optional_sensors() -> dict[str, dict[str, object]]:
    """Lines for `sensors` of a vehicle file: sensors that a vehicle may have and the Hindrax has not."""
    file = share_folder("config") / "optional_sensors.yaml"
    found: dict[str, dict[str, object]] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return found


def simulated_vehicle() -> Path:
    """Return the file of the vehicle that ArduSub's simulator has with `vectored_6dof`."""
    return share_folder("config") / "ardusub-sitl.yaml"


def hindrax_with(*names: str) -> Vehicle:
    """The Hindrax with some of the optional sensors on board."""
    data, optional = yaml.safe_load(default_vehicle().read_text(encoding="utf-8")), optional_sensors()
    data["sensors"] |= {name: optional[name] for name in names}
    return build(Vehicle, data, f"{default_vehicle()} with {', '.join(names)}:")


def own_vehicles() -> Path:
    """Folder of this user's vehicle files."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser() / "hindrax"


def usual_vehicle() -> str:
    """Return the vehicle where none is named: that of the environment variable, or the Hindrax."""
    return os.environ.get(VEHICLE) or str(default_vehicle())


def vehicle_file(name: str) -> Path:
    """Return the file of a vehicle: a file as it is named, else NAME.yaml here, of this user, or of the clone.

    Parameters
    ----------
    name
        Path with a suffix or a folder, or the name of a vehicle.

    Returns
    -------
    Path
        As it is named, whether there is such a file or not; of a name, the first that there is.

    Raises
    ------
    UsageError
        Where no file has this name; lists those that there are.
    """
    path = Path(name).expanduser()
    if path.suffix or len(path.parts) != 1:
        return path
    folders = (Path(), own_vehicles(), share_folder("vehicles"))
    for folder in folders:
        if (folder / f"{name}.yaml").is_file():
            return folder / f"{name}.yaml"
    if path.exists():
        return path
    names = sorted({file.stem for folder in folders[1:] for file in folder.glob("*.yaml")})
    meant, known = did_you_mean(name, names), ", ".join(names)
    raise UsageError(
        f"vehicle {name}{meant}: found no {name}.yaml here, in {own_vehicles()} or in the clone; wanted one of {known},"
        " or a file; `./hindrax vehicle new` makes one"
    )


def vehicle_word(file: Path) -> str:
    """The shortest word for a file that `--vehicle` takes here: none for the default one, its name, else its path."""
    if file == default_vehicle():
        return ""
    try:
        found = vehicle_file(file.stem)
    except UsageError:
        return str(file)
    return file.stem if found.resolve() == file.resolve() else str(file)
