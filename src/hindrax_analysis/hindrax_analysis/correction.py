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
        One sentence; empty where nothing of importance was corrected.
    """
    if not results.vehicle.losses:
        return "no loss of thrust is corrected: `losses: false` in the vehicle file"
    known = {name: one.drag.correction for name, one in results.motions.items() if one.drag is not None}
    shown = [f"{name} {share:+.0%}" for name, share in known.items() if abs(share) >= LEAST_SHARE]
    if not shown:
        return ""
    corrected = f"drag corrected by losses that water may have: {', '.join(shown)}"
    return f"{corrected}; for a simulator without any, `losses: false` in the vehicle file" if remedy else corrected
