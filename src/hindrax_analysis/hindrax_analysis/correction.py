"""The words of the correction: by how much what is probable in water changed each drag, and where nothing is."""

from hindrax_ident.assess.results import Results

LEAST_SHARE = 0.01
"""Correction of a drag that is said [-]."""


def what_was_corrected(results: Results, *, remedy: bool = True) -> str:
    """Say by how much the drag at the highest speed is corrected, and how to say that nothing takes thrust.

    Parameters
    ----------
    results
        Of all motions.
    remedy
        Whether to say what to write for a simulator without losses; beside a report, which says it, it is noise.

    Returns
    -------
    str
        One sentence; empty where nothing of importance was corrected. A drag that may be zero has no correction: where
        its motion is refused, that says why, and else it is named.
    """
    if not results.vehicle.losses:
        return "no loss of thrust is corrected: `losses: false` in the vehicle file"
    found = {name: (one.drag.correction, one.identifiable) for name, one in results.motions.items() if one.drag}
    shown = [f"{name} {x:+.0%}" for name, (x, _) in found.items() if x is not None and abs(x) >= LEAST_SHARE]
    unknown = [name for name, (share, identifiable) in found.items() if share is None and identifiable]
    said = [f"drag corrected by losses that water may have: {', '.join(shown)}"] if shown else []
    said += [f"drag not known well enough to state its correction: {', '.join(unknown)}"] if unknown else []
    if shown and remedy:
        said.append("for a simulator without any, `losses: false` in the vehicle file")
    return "; ".join(said)
