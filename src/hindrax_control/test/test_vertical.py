"""The vertical filter beside the Kalman filter of filterpy: the same states and covariance from the same readings."""

import random

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from hindrax_control.navigator import NavigatorKnobs
from hindrax_control.vertical import VerticalFilter


def peer(knobs):
    kf = KalmanFilter(dim_x=4, dim_z=1, dim_u=1)
    kf.P = np.diag([1e4, 0.25, knobs.heave_bias_mps2**2, 1e4])
    return kf


def predict(kf, knobs, acceleration_mps2, dt):
    half, a = 0.5 * dt * dt, knobs.accelerometer_noise**2
    F = np.eye(4)
    F[0, 1:3], F[1, 2] = (dt, half), dt
    Q = np.diag([a * dt**3 / 3.0, a * dt, knobs.heave_bias_walk**2 * dt, knobs.floor_walk**2 * dt])
    Q[0, 1] = Q[1, 0] = a * half
    kf.predict(u=acceleration_mps2, B=np.array([[half], [dt], [0.0], [0.0]]), F=F, Q=Q)


def test_it_says_what_filterpy_says():
    knobs, dice = NavigatorKnobs(), random.Random(4)
    ours, theirs = VerticalFilter(knobs), peer(knobs)
    for step in range(400):
        dt, acceleration_mps2 = dice.choice((0.02, 0.0178)), dice.gauss(0.0, 0.02)
        ours.predict(acceleration_mps2, dt)
        predict(theirs, knobs, acceleration_mps2, dt)
        depth_m, altitude_m, delay_s = dice.gauss(1.0, 0.003), dice.gauss(2.0, 0.01), dice.uniform(0.0, 0.02)
        bend_m = 0.5 * delay_s**2 * acceleration_mps2
        assert ours.depth(depth_m, 0.003, delay_s)
        theirs.x[0, 0] = theirs.x[0, 0] if step else depth_m
        theirs.update(depth_m - bend_m, R=0.003**2, H=np.array([[1.0, -delay_s, 0.0, 0.0]]))
        assert ours.altitude(altitude_m, 0.01, delay_s)
        theirs.x[3, 0] = theirs.x[3, 0] if step else altitude_m + theirs.x[0, 0]
        theirs.update(altitude_m + bend_m, R=0.01**2, H=np.array([[-1.0, delay_s, 0.0, 1.0]]))
    (z,), (rate,), _, (floor,) = theirs.x
    assert ours.depth_m == pytest.approx(z, rel=1e-9)
    assert ours.rate_mps == pytest.approx(rate, rel=1e-9)
    assert ours.altitude_m == pytest.approx(floor - z, rel=1e-9)
    assert ours.rate_variance == pytest.approx(theirs.P[1, 1], rel=1e-9)
