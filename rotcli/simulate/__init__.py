"""Exact logs of an IMU on a still or turning table, with the true values."""
