"""Gyro biases, scale factor and installation errors about one table axis (R16)."""
