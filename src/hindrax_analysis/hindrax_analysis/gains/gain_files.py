"""Gains as our nodes, an ArduSub and other controllers take them."""

from collections.abc import Mapping
from dataclasses import asdict

import yaml

from hindrax_analysis.gains.hold_gains import AxisGains, HoldGains

ARDUSUB_AXES = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
HALF_THROTTLE = 0.5
"""ArduSub's throttle is 0 to 1 and rests at one half, so half of it is all of the vertical thrust."""
ACCZ_SCALE = 0.1
"""Throttle per m/s^2 and unit of PSC_ACCZ_P up to ArduSub 4.6: a hundred cm/s^2 times a thousandth."""


def parameter_file(gains: HoldGains, source: str) -> str:
    """ROS parameter file for the pilot, as `--params` of `up` and `pool-test` takes it."""
    lines = (
        f"Hold gains of {gains.vehicle.name} from {source}: the fastest whose margins hold for {gains.drawn} vehicles",
        "drawn from its uncertainty. They are made for the hydrodynamics of that result: write these into the vehicle",
        "file first (`./hindrax export --to vehicle`). Use: `./hindrax up --params THIS_FILE`.",
        *_caution(gains),
    )
    knobs = {f"holds.{name}": value for name, value in asdict(gains.holds).items()}
    knobs |= {f"station.{name}": value for name, value in asdict(gains.station).items()}
    block = {"/**/pilot": {"ros__parameters": knobs}}
    return "".join(f"# {line}\n" for line in lines) + str(yaml.safe_dump(block, sort_keys=False))


def ardusub_parameters(gains: HoldGains) -> Mapping[str, float]:
    """ArduSub's cascades with the same poles, per axis that it controls.

    Its angle loop asks for a rate, ANG_P e, and its rate loop for a part of the largest moment, RAT_P (ANG_P e - r): so
    K_d = RAT_P N and K_p = ANG_P K_d, where N is the moment of full output. Depth: a = VELZ_P (POSZ_P e - w), of which
    ACCZ_P makes a throttle. Its outputs go to pulses without a thrust curve, so the gains hold near half thrust.

    Parameters
    ----------
    gains
        Of our holds, with the vehicle.

    Returns
    -------
    Mapping[str, float]
        By ArduSub's name of the parameter.
    """
    found: dict[str, float] = {}
    for axis, name in ARDUSUB_AXES.items():
        if axis not in gains.axes:
            continue
        one = gains.axes[axis]
        angle, rate, integral = _cascade(one)
        found[f"ATC_ANG_{name}_P"] = angle
        found[f"ATC_RAT_{name}_P"] = rate / one.thrust
        found[f"ATC_RAT_{name}_I"] = integral / one.thrust
    if "heave" in gains.axes:
        one = gains.axes["heave"]
        position, force, _ = _cascade(one)
        throttle = HALF_THROTTLE * one.inertia / one.thrust
        found["PSC_POSZ_P"] = position
        found["PSC_VELZ_P"] = force / one.inertia
        found["PSC_ACCZ_P"] = throttle / ACCZ_SCALE
        found["PSC_ACCZ_I"] = throttle / ACCZ_SCALE / one.law.integral_s
    return {name: float(f"{value:.3g}") for name, value in found.items()}


def ardusub_file(gains: HoldGains, source: str) -> str:
    """Parameter file as ground stations load it: NAME,VALUE."""
    lines = (
        f"{gains.vehicle.name} from {source}: ArduSub 4.1 to 4.6. From 4.7 on PSC_POSZ_P, PSC_VELZ_P, PSC_ACCZ_P are",
        "PSC_D_POS_P, PSC_D_VEL_P and a tenth in PSC_D_ACC_P. Its outputs have no thrust curve: right near half",
        "thrust. Load them with the vehicle disarmed, and dive with a hand on the disarm button.",
        *_caution(gains),
    )
    head = "".join(f"# {line}\n" for line in lines)
    return head + "".join(f"{name},{value:g}\n" for name, value in ardusub_parameters(gains).items())


def _caution(gains: HoldGains) -> tuple[str, ...]:
    return (f"{gains.caution}.",) if gains.caution else ()


def _cascade(one: AxisGains) -> tuple[float, float, float]:
    """Proportional gain of the outer loop [1/s], P and I of the inner one [N s/m, N/m]."""
    law = one.law
    return law.proportional / law.derivative, law.derivative, law.derivative / law.integral_s
