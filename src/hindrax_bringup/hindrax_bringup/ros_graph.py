"""Settings of the environment that decide which ROS graph a process joins.

A shell may have any of them, from a .bashrc or for another robot. A stack of ours has a graph of its own making, and a
command has that of its stack: what the stack has is set, and what it does not have is removed.
"""

import os
import re
import shutil
from collections.abc import Mapping, MutableMapping
from pathlib import Path

from hindrax_core import stack_time
from hindrax_core.errors import UsageError

DOMAIN, RMW, RANGE = "ROS_DOMAIN_ID", "RMW_IMPLEMENTATION", "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILES = (PROFILE, "FASTDDS_DEFAULT_PROFILES_FILE")
"""Either names a profile of Fast DDS."""
SHOWN = (DOMAIN, RMW, RANGE, PROFILE)
"""Settings with which ROS 2 tools join a graph."""
OUR_RMW = "rmw_fastrtps_cpp"
"""The middleware that reads our profiles, by which the graph is bound to this machine and its tether."""
PREFIXES = (
    *("ROS_", "RMW_", "RCL_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_", "ZENOH_", "NDDS_", "CONNEXTDDS_"),
    stack_time.VARIABLE,
)
OF_THE_INSTALLATION = frozenset(
    ("ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION", "ROS_HOME", "ROS_LOG_DIR", "ROS_PACKAGE_PATH", "ROS_ROOT")
)
"""Which ROS this is and where it keeps its files: the same in every graph."""
SECURITY = "ROS_SECURITY_"
HIGHEST_DOMAIN = 232
"""Above it the ports of a domain do not exist (OMG DDSI-RTPS 2.3, section 9.6.1.1)."""
SHARED_MEMORY, LEAST_BYTES = Path("/dev/shm"), 1 << 16  # noqa: S108  # not ours to make files in
"""The client library maps two pages there as it is imported (LTTng), and dies of a bus error where there are none."""
RMW_RESOURCES = "share/ament_index/resource_index/rmw_typesupport"


def is_graph_setting(name: str) -> bool:
    """Whether a variable decides which graph a process joins, or by which time it lives there."""
    return name.startswith(PREFIXES) and name not in OF_THE_INSTALLATION


def graph_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Pick these settings; the domain is always among them."""
    return {DOMAIN: "0"} | {name: value for name, value in environment.items() if is_graph_setting(name)}


def without_graph(environment: Mapping[str, str], *kept: str) -> dict[str, str]:
    """Environment without these settings, but for those that begin with `kept`."""
    return {
        name: value for name, value in environment.items() if not is_graph_setting(name) or name.startswith(kept or "=")
    }


def has_own_profile(environment: Mapping[str, str]) -> bool:
    """Whether the user has a profile of the middleware, and so decides on the graph."""
    return any(environment.get(name) for name in PROFILES)


def exported_domain(environment: Mapping[str, str]) -> int | None:
    """Domain that a terminal has chosen, None where it has not. UsageError for one that does not exist."""
    found = environment.get(DOMAIN, "")
    if not found:
        return None
    # Exactly what every reader takes for the same number: rcl reads 010 as 8, and -1 as a number too.
    if not re.fullmatch(r"0|[1-9][0-9]{0,2}", found) or int(found) > HIGHEST_DOMAIN:
        raise UsageError(f"{DOMAIN}: found {found!r}, wanted 0 to {HIGHEST_DOMAIN}; set it, or `unset {DOMAIN}`")
    return int(found)


def missing_rmw(environment: Mapping[str, str]) -> str:
    """Middleware that is named and not installed, with those that are: the client library would end the process."""
    name = environment.get(RMW, "")
    folders = [Path(one) / RMW_RESOURCES for one in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if one]
    found = sorted({file.name for folder in folders if folder.is_dir() for file in folder.iterdir()})
    return f"found {name}, installed is {', '.join(found)}" if name and found and name not in found else ""


def without_missing_rmw(environment: MutableMapping[str, str]) -> None:
    """Replace a middleware that is not installed: what only reads bags must not fail for want of it."""
    if missing_rmw(environment):
        environment[RMW] = OUR_RMW


def set_aside(shell: Mapping[str, str], graph: Mapping[str, str]) -> list[str]:
    """Settings of a shell that a graph does not have: a ROS tool in that shell would look elsewhere."""
    return sorted(name for name, value in shell.items() if value and is_graph_setting(name) and name not in graph)


def lines_to_join(shell: Mapping[str, str], graph: Mapping[str, str]) -> list[str]:
    """Lines with which a terminal with the settings of a shell joins a graph, for ROS 2 tools in it."""
    aside = [f"unset {name}" for name in set_aside(shell, graph)]
    return [*aside, *(f"export {key}={value}" for key, value in sorted(graph.items()) if key in SHOWN)]


def full_shared_memory(place: Path = SHARED_MEMORY) -> str:
    """Why the client library cannot be imported here, with the remedy; empty where it can."""
    try:
        free = shutil.disk_usage(place).free
    except OSError:  # there is none: then nothing is mapped
        return ""
    remedy = "remove the files that ended processes left there (`ls -l`), or give a container more (`--shm-size`)"
    found = f"{place} is full: {free // 1000} kB are free, {LEAST_BYTES // 1000} kB are wanted"
    return f"{found}; {remedy}" if free < LEAST_BYTES else ""
