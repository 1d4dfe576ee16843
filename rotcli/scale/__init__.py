"""Scale factor test over rates: error curve, asymmetry, nonlinearity, hysteresis, misalignment.

The error curve of gyro i for a rate w about the table axis is `e(w) = reading - true`. Practice of
IEEE Std 647, 952, 1431 and 2700, terms of IEEE Std 528.
"""
