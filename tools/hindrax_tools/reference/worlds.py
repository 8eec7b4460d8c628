"""Page of the mock's worlds, from the table of conditions."""

from __future__ import annotations

from hindrax_sim.conditions.world_table import CONDITIONS, FORM, Condition
from hindrax_tools.reference.markdown import code, head, number, table

ABOUT = f"""What the mock's world can do that the model does not know: `--world` of `pool-test --mock`, `up --mock`,
`mock` and `montecarlo`. In *ideal* all are off; in *pool* the seed draws all of them. The form is
{FORM}. A name alone has the size given here. Shares are fractions.
[Worlds that are not the model](../explanation/worlds.md) explains them."""


def page() -> str:
    """Return the page."""
    columns = ("name", "size", "in pool", "how it acts", "where the size comes from")
    return f"{head('Worlds of the mock', ABOUT)}\n{table(columns, map(_cells, CONDITIONS.values()))}"


def _cells(row: Condition) -> tuple[str, ...]:
    unit = "" if row.unit == "-" else f" {row.unit}"
    return (code(row.name), f"{number(row.size)}{unit}", f"{row.draw}{unit}", row.meaning, row.source)
