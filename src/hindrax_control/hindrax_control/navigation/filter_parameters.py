"""What the navigator's filters share: noise of the accelerometer, and when a measurement is not believed."""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core.knobs import knob


@dataclass(frozen=True)
class FilterKnobs:
    """Noise and gates of all filters."""

    accelerometer_noise: float = knob(0.01, 1e-4, 10.0, "noise of the acceleration [m/s^2/sqrt(Hz)]")
    gate: float = knob(5.0, 1.0, 100.0, "innovation, in standard deviations, above which a measurement is refused [-]")
    patience: int = knob(10, 1, 1000, "refusals in a row after which a filter lets go of its state [-]")
