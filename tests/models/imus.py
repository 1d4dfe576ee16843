"""Slow noise and white noise of the gyros of R16's two IMUs."""

from rotcli.models.mean_covariance import SlowNoise

# deg/h, deg/h/sqrt(s), deg/h sqrt(s): 1 deg/sqrt(h) is 60 deg/h sqrt(s).
NAV440 = SlowNoise(15.66, 0.35), 0.4 * 60
MTIG = SlowNoise(8.28, 2.6), 3.0 * 60
IMUS = {"NAV440": NAV440, "MTi-G": MTIG}
