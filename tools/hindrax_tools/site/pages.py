"""Pages of `docs` as the site shows them: links out of the folder, formulas, navigation, pages of the library."""

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import PurePosixPath

ELSEWHERE = {
    "README.md": "README.md",
    "docs/README.md": "README.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "docs/how-to/analyze-in-python.ipynb": "how-to/analyze-in-python.md",
}
"""Files of the clone that have a page of another name, or one although they lie outside of `docs`."""
API: Mapping[str, Sequence[str]] = {
    "Analysis": ("hindrax_analysis.api", "hindrax_analysis.identification.known_weight"),
    "Vehicle": (
        "hindrax_core.vehicle",
        "hindrax_core.thrust.curves",
        "hindrax_core.hydrostatics",
        "hindrax_core.rotation",
    ),
    "Identification": (
        "hindrax_ident.model.motion_model",
        "hindrax_ident.model.model_parameters",
        "hindrax_ident.model.coriolis",
        "hindrax_ident.model.simulation",
        "hindrax_ident.online.session",
        "hindrax_ident.online.rls",
        "hindrax_ident.fit.output_error",
        "hindrax_ident.assess.prediction",
        "hindrax_ident.assess.results",
    ),
    "Allocation": (
        "hindrax_control.allocation.effectiveness",
        "hindrax_control.allocation.allocator",
        "hindrax_control.allocation.thrust_curve",
    ),
    "Records": (
        "hindrax_bag.read.bag_reader",
        "hindrax_bag.read.message_columns",
        "hindrax_analysis.records.recording",
    ),
    "Sensors": (
        "hindrax_core.driver_interface",
        "hindrax_core.bus_operations",
        "hindrax_core.readings",
        "hindrax_core.sensor_table",
        "hindrax_core.knobs",
        "hindrax_core.testing",
    ),
    "Bench experiments": (
        "hindrax_laboratory.free_decay",
        "hindrax_laboratory.forced",
        "hindrax_laboratory.pendulum",
        "hindrax_laboratory.step",
        "hindrax_laboratory.towing",
        "hindrax_laboratory.bollard",
        "hindrax_laboratory.thruster_sheets",
        "hindrax_laboratory.decay",
        "hindrax_laboratory.least_squares",
        "hindrax_laboratory.experiment_record",
    ),
}
"""Modules of each page of the library."""
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)")
FENCE = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$(.+?)\$\$|(?<![\\$\w`])\$((?:[^$\n`]|\n(?!\n))+)\$(?!\w)", re.DOTALL)


def outside_fences(text: str, change: Callable[[str], str]) -> str:
    """Change the text of a page, and leave its fenced blocks as they are."""
    parts, at = [], 0
    for fence in FENCE.finditer(text):
        parts += [change(text[at : fence.start()]), fence[0]]
        at = fence.end()
    return "".join([*parts, change(text[at:])])


def relinked(text: str, page: str, repository: str) -> str:
    """Links of a page (its path in the clone) that lead out of `docs`: to their page here, to the repository, or none.

    `repository`: address of the files at this version; empty where there is none, and then the words stay.
    """
    here = PurePosixPath(page)

    def replaced(found: re.Match[str]) -> str:
        words, target = found[1], found[2]
        path, _, anchor = target.partition("#")
        if "://" in target or not path:
            return found[0]
        inside = os.path.normpath(str(here.parent / path))
        if inside in ELSEWHERE or inside.startswith("docs/"):
            to = ELSEWHERE.get(inside, inside.removeprefix("docs/"))
            start = PurePosixPath(ELSEWHERE.get(page, page.removeprefix("docs/"))).parent
            link = os.path.relpath(to, start)
            return f"[{words}]({link}{'#' + anchor if anchor else ''})"
        return f"[{words}]({repository}/{inside})" if repository else words

    return outside_fences(text, lambda part: LINK.sub(replaced, part))


Formula = tuple[str, bool]
"""TeX, and whether it stands on lines of its own."""


def _formula(found: re.Match[str]) -> Formula:
    return (found[1] or found[2], bool(found[1]))


def formulas_of(text: str) -> list[Formula]:
    """Formulas of a page in their order; none where no formula has lines of its own, for a dollar is also a dollar."""
    prose = FENCE.sub("", text)
    return [_formula(one) for one in FORMULA.finditer(prose)] if "$$" in prose else []


def with_formulas(text: str, drawn: Mapping[Formula, str]) -> str:
    """The page with each formula as it is drawn."""
    if not drawn:
        return text
    return outside_fences(text, lambda part: FORMULA.sub(lambda one: drawn[_formula(one)], part))


def navigation(overview: str, decisions: Sequence[str]) -> list[dict[str, object]]:
    """Navigation by the overview of the documentation: a section a bold heading, an entry a link of a list."""
    sections: list[dict[str, object]] = [{"Home": "README.md"}]
    entries: list[dict[str, str]] = []
    for line in overview.splitlines():
        if heading := re.match(r"\*\*(.+?)\*\*", line):
            entries = []
            sections.append({heading[1]: entries})
        for words, target in LINK.findall(line):
            page = ELSEWHERE.get(f"docs/{target}", target)
            if "://" not in page and not page.startswith("adr/"):
                entries.append({words[:1].upper() + words[1:]: page})
    library = [{title: f"api/{slug(title)}.md"} for title in API]
    listed = [one for one in decisions if one != "adr/README.md"]
    return [
        *sections,
        {"Library": library},
        {"Decisions": ["adr/README.md", *listed]},
        {"Project": ["contributing.md", "changelog.md"]},
    ]


def slug(title: str) -> str:
    """File name of a page of the library."""
    return title.lower().replace(" ", "-")


def api_page(title: str, modules: Sequence[str]) -> str:
    """A page of the library: its modules by their docstrings."""
    return f"# {title}\n\n" + "".join(f"::: {name}\n\n" for name in modules)
