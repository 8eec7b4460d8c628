"""Tuning parameters of the identification: each number once, with its default, range and meaning."""

from dataclasses import dataclass, replace

from hindrax_core.knobs import choice, knob
from hindrax_core.signals import PHASES

STAMP_SIGMA_S = 0.03
"""Prior standard deviation between stamps of different topics: delays, jitter and slow sampling resemble a lag."""
LAG_SIGMA_S = 0.1
"""Prior standard deviation of the thrust lag, and of the latency of the velocities."""
LAG_DIFFERENCE_S = 0.05
"""Prior standard deviation of the lag of thrust that goes, turns round, or changes by its largest, from that of thrust
that comes a little: half of that of the lag itself."""
USUAL_LAG_S = 0.15
"""Usual thrust lag of small vehicles, where the vehicle file has none."""
USUAL_LATENCY_S = 0.05
"""Usual latency of velocities from a filter or a camera, where unknown."""
THRUST_SHARE = 0.025
"""Unmodeled dead band of the thrusters or pull of a tether, share of the largest thrust [-]."""


@dataclass(frozen=True, slots=True)
class Tuning:
    """Knobs of the session. The defaults suit a vehicle with a time constant of about one second."""

    estimator: str = choice(
        "rls", ("rls", "ekf"), "estimator published online: recursive least squares or the joint filter"
    )
    forgetting: float = knob(1.0, 0.9, 1.0, "weight kept per sample [-]")
    filter_rate: float = knob(1.0, 0.05, 20.0, "pole of the regression filter until the drag is known [1/s]")
    filter_slowest: float = knob(1.0, 0.01, 20.0, "lowest pole of the regression filter [1/s]")
    filter_fastest: float = knob(5.0, 0.05, 50.0, "highest pole of the regression filter [1/s]")
    bin_s: float = knob(0.015, 0.0, 1.0, "faster velocities are averaged over this time [s]")
    reorder_s: float = knob(0.5, 0.0, 5.0, "time a measurement waits for others with an earlier stamp [s]")
    lagging_s: float = knob(5.0, 0.0, 60.0, "longest wait for a topic whose messages lag behind the others' [s]")
    velocity_latency_s: float | None = knob(
        None, -1.0, 1.0, "latency of the velocity stamps, which is taken off them; none: not known [s]"
    )
    gap_s: float = knob(1.0, 0.1, 60.0, "pause between velocities after which the filters restart [s]")
    thrust_age_s: float = knob(2.0, 0.1, 3600.0, "age above which the last thrust is no longer used [s]")
    outlier_sigmas: float = knob(5.0, 2.0, 100.0, "innovation above which a sample is rejected [standard deviations]")
    stretch_s: float = knob(60.0, 5.0, 3600.0, "longest stretch simulated from one initial condition [s]")
    buoyancy_sigma_N: float | None = knob(
        None, 0.0, 1e3, "standard deviation of the weighed net buoyancy; none: not weighed [N]"
    )
    timing_sigma_s: float = knob(0.003, 0.0, 0.1, "standard deviation of velocity stamps against thrust stamps [s]")
    stamp_doubt_s: float | None = knob(
        None,
        0.0,
        1.0,
        "standard deviation of the stamps that residuals cannot correct; none: by its stack [s]",
    )
    lag_doubt_s: float | None = knob(
        None, 1e-3, 1.0, "prior standard deviation of lag and latency; none: by its stack [s]"
    )
    tilt_sigma_rad: float = knob(0.003, 0.0, 0.5, "error of roll and pitch from a calibrated accelerometer [rad]")
    raw_tilt_sigma_rad: float = knob(
        0.0125, 0.0, 0.5, "error of roll and pitch from an uncalibrated accelerometer [rad]"
    )
    mount_sigma_rad: float = knob(
        0.02, 0.0, 0.5, "error of roll and pitch from the mount, part of the calibrated uncertainty [rad]"
    )
    velocity_gain_sigma: float = knob(
        0.0, 0.0, 0.5, "standard deviation of the velocity gain, part of the calibrated uncertainty [-]"
    )
    wrench_gain_sigma: float = knob(
        0.0, 0.0, 1.0, "standard deviation of the gain of a wrench without thrust curves, calibrated uncertainty [-]"
    )
    thrust_doubt: float | None = knob(
        None, 0.0, 0.5, "unmodeled dead band or pull, share of the largest thrust; none: by its stack [-]"
    )
    current_sigma_mps: float = knob(0.02, 0.0, 1.0, "unmeasured steady current, for uncertainty and verdict [m/s]")
    plateaus_only: bool = knob(False, meaning="learn only from the plateaus of a maneuver")
    phases: tuple[str, ...] = choice(
        ("hover", "transient", "plateau", "coast", "excite"), PHASES, "phases used for learning"
    )


def for_foreign_records(tuning: Tuning) -> Tuning:
    """Knobs for measurements of another stack, whose stamps, lag and thrusters are less well known.

    Parameters
    ----------
    tuning
        What is set in it stays, also where it is 0.

    Returns
    -------
    Tuning
        With doubts where it had none.
    """
    return replace(
        tuning,
        stamp_doubt_s=STAMP_SIGMA_S if tuning.stamp_doubt_s is None else tuning.stamp_doubt_s,
        thrust_doubt=THRUST_SHARE if tuning.thrust_doubt is None else tuning.thrust_doubt,
        lag_doubt_s=LAG_SIGMA_S if tuning.lag_doubt_s is None else tuning.lag_doubt_s,
    )
