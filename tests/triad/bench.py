"""The table, the noise and the sequences that the published figures of these tests belong to."""

import numpy as np

from rotcli.models.rotation import axis_rotation
from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import blocks_of_motion
from rotcli.models.triad.information import Problem
from rotcli.models.triad.kinematics import table
from rotcli.units import DEG, DEG_PER_HOUR

LATITUDE = 51.08 * DEG
# Size of the prototype's force in spot case 3 (printed to 12 digits) less its gravity offset.
GRAVITY = float(np.linalg.norm([2.387367850976, 9.475663054718, -0.847559872547])) - 2e-4
RATE = 100.0
# One sample of 0.4 deg/sqrt(h) and 0.05 m/s/sqrt(h) at 100 Hz.
SIGMA_1 = np.repeat([0.4 * DEG / 60.0 * 10.0, 0.05 / 60.0 * 10.0], 3)

X, Y, Z = np.eye(3)
HALF, QUARTER = np.pi, np.pi / 2.0


def cube(first, second):
    """Return six mountings: as it is, upside down, and four quarter turns."""
    turns = [(first, HALF), (first, QUARTER), (first, -QUARTER)]
    turns += [(second, QUARTER), (second, -QUARTER)]
    return [np.eye(3)] + [axis_rotation(a, angle) for a, angle in turns]


def three_axes():
    return table("zxy", latitude=LATITUDE, gravity=GRAVITY)


def problem(nominal, groups=p.BASIC, *, exact=False, priors=None):
    free = p.select(groups, nominal.axis_count, mountings=nominal.mounting_count)
    if exact:
        free = free[free < p.FIXED_COUNT]
    priors = p.default_priors(nominal.mounting_count) if priors is None else priors
    return Problem(nominal, free, priors, SIGMA_1)


def blocks(motion):
    return blocks_of_motion(motion.motion(), RATE)


def spot_parameters():
    """Return a parameter vector with every entry different from zero."""
    x = np.zeros(p.count())
    x[p.N] = np.array([1000, -200, 300, 400, -1500, 600, -700, 800, 900]) * 1e-6
    x[p.GYRO_BIAS] = np.array([50, -60, 70]) * DEG_PER_HOUR
    x[p.G] = np.array([10, -2, 3, 4, -15, 6, -7, 8, 9]) * p.G_UNIT
    x[p.GYRO_ASYMMETRY] = np.array([100, -50, 20]) * 1e-6
    x[p.M] = np.array([-500, 120, -130, 140, 700, -160, 170, 180, -900]) * 1e-6
    x[p.ACCEL_BIAS] = [0.01, -0.02, 0.03]
    x[p.K2] = np.array([100, -50, 20]) * p.K2_UNIT
    x[p.ACCEL_ASYMMETRY] = np.array([30, -40, 50]) * 1e-6
    x[p.LEVERS] = [0.05, 0.01, -0.02, 0.04, 0.02, -0.01, 0.03, 0.0, 0.06]
    x[p.BASE] = [1e-3, -2e-3, 3e-3]
    x[[p.OUTER_MIDDLE, p.MIDDLE_INNER, p.MIDDLE_ZERO]] = [0.2e-3, -0.3e-3, 0.4e-3]
    x[[p.CLOCK_GYRO, p.CLOCK_ACCEL, p.GRAVITY]] = [1e-3, -2e-3, 2e-4]
    return x


SPOT_ANGLES = np.array([[0, 0, 0], [30, -40, 50], [200, 75, -110]]).T * DEG
SPOT_RATES = np.array([[0, 0, 0], [60, 0, 0], [20, -30, 100]]).T * DEG
SPOT_ACCELERATIONS = np.array([[0, 0, 0], [0, 0, 0], [5, 20, -10]]).T * DEG
