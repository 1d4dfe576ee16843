"""Bias and scale factor over temperature, thermometer lag, thermal hysteresis and warm-up.

Soaks and ramps, heating and cooling, still and turning blocks of one or several logs enter one
generalised least squares `z = d(T) + K(T) w`. Temperatures in degC, times in s.
"""
