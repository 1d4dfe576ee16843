"""Full calibration of an IMU: on a table of one, two or three axes, or by hand."""
