"""The sensor triads of an IMU on a table of one, two or three axes: motion, model, information."""
