"""Prediction of a record by saved coefficients, which were fitted to another."""

from collections.abc import Mapping

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.prediction import Prediction, predict, windows_of
from hindrax_ident.assess.results import Number
from hindrax_ident.model.motion_model import Model, model_of, motions_of
from hindrax_ident.records.axis_record import Record


def parameters(model: Model, motions: Mapping[str, Mapping[str, Number]]) -> Array:
    """Parameters of a model (p,), in the order of its names, from the coefficients of each motion.

    UsageError names what is missing.
    """
    found: dict[str, float] = {}
    for motion in motions_of(model.axis):
        numbers = motions.get(motion.name, {})
        names = dict(zip(("k_q", "k_l", "b", "added_mass", "k_r"), model.names_of(motion.side), strict=False))
        found |= {names[name]: one.value for name, one in numbers.items() if name in names}
    lacking = [name for name in model.names if name not in found]
    if lacking:
        raise UsageError(
            f"{AXES[model.axis]}: found no {' and no '.join(lacking)} (mass: added_mass) in the coefficients"
        )
    found["mass"] += model.rigid
    return array([found[name] for name in model.names])


def predict_record(
    motions: Mapping[str, Mapping[str, Number]], vehicle: Vehicle, axis: int, record: Record, window_s: float
) -> Prediction:
    """Free-running prediction over windows of the record of one axis. HindraxError where there is none to predict."""
    model = model_of(vehicle, axis)
    theta = parameters(model, motions)
    windows = windows_of(record.stretches, window_s)
    if not windows:
        longest = max((stretch.end_s - stretch.start_s for stretch in record.stretches), default=0.0)
        raise HindraxError(
            f"{AXES[axis]}: no stretch of the record lasts {window_s:g} s, the longest {longest:.3g} s; "
            "choose a shorter --window"
        )
    try:
        return predict(model, theta, record.with_stretches(windows))
    except ValueError as error:
        raise HindraxError(f"{AXES[axis]}: {error}, in windows of {window_s:g} s") from None
