"""How the identification is tuned: every number once, with its default, range and meaning."""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core.knobs import choice, knob


@dataclass(frozen=True, slots=True)
class Tuning:
    """Knobs of the session. The defaults serve a vehicle with a time constant of about a second."""

    estimator: str = choice(
        "rls", ("rls", "ekf"), "what is published online: recursive least squares or the joint filter"
    )
    forgetting: float = knob(1.0, 0.9, 1.0, "weight kept per sample [-]")
    filter_rate: float = knob(1.0, 0.05, 20.0, "pole of the regression filter until the drag is known [1/s]")
    filter_slowest: float = knob(1.0, 0.01, 20.0, "lowest pole the regression filter takes [1/s]")
    filter_fastest: float = knob(5.0, 0.05, 50.0, "highest pole the regression filter takes [1/s]")
    bin_s: float = knob(0.015, 0.0, 1.0, "velocities that come faster are averaged over this time [s]")
    reorder_s: float = knob(0.25, 0.0, 5.0, "how long an event waits for others with an earlier stamp [s]")
    velocity_latency_s: float = knob(0.0, -1.0, 1.0, "by how much the stamps of velocities are late [s]")
    gap_s: float = knob(1.0, 0.1, 60.0, "pause between velocities after which filters start again [s]")
    thrust_age_s: float = knob(2.0, 0.1, 3600.0, "age of the last thrust above which it is not believed [s]")
    outlier_sigmas: float = knob(5.0, 2.0, 100.0, "innovation above which a sample is refused [standard deviations]")
    stretch_s: float = knob(60.0, 5.0, 3600.0, "longest stretch that is simulated from one initial condition [s]")
    buoyancy_sigma_N: float = knob(0.0, 0.0, 1e3, "how well net buoyancy is known from weighing; 0: not at all [N]")
    timing_sigma_s: float = knob(0.003, 0.0, 0.1, "stamps of velocities against those of thrust [s]")
    stamp_doubt_s: float = knob(0.0, 0.0, 1.0, "error of stamps that residuals are not trusted to tell [s]")
    lag_doubt_s: float = knob(0.0, 0.0, 1.0, "error of lag and stamps before the record; 0: those of our own stack [s]")
    tilt_sigma_rad: float = knob(0.003, 0.0, 0.5, "error of roll and pitch by a calibrated accelerometer [rad]")
    raw_tilt_sigma_rad: float = knob(0.0125, 0.0, 0.5, "error of roll and pitch by one as it was delivered [rad]")
    mount_sigma_rad: float = knob(0.02, 0.0, 0.5, "error of roll and pitch by the mount, calibrated band [rad]")
    velocity_gain_sigma: float = knob(0.0, 0.0, 0.5, "standard deviation of the velocity's gain, calibrated band [-]")
    wrench_gain_sigma: float = knob(0.0, 0.0, 1.0, "gain of a wrench no curve stands behind, calibrated band [-]")
    thrust_doubt: float = knob(
        0.0, 0.0, 0.5, "dead band or pull nobody knows of, share of the largest thrust, calibrated band and verdict [-]"
    )
    current_sigma_mps: float = knob(0.02, 0.0, 1.0, "steady current nobody knows of, calibrated band and verdict [m/s]")
    plateaus_only: bool = knob(False, meaning="learn from the plateaus of a maneuver alone")
    phases: tuple[str, ...] = knob(("hover", "transient", "plateau", "excite"), meaning="phases that teach")
