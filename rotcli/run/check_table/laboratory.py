"""Checks of tests over rates and temperatures."""

from rotcli.run.check_table.row import Check

CHECKS: tuple[Check, ...] = (
    Check(
        "noise-figures-missing",
        "noise figures present in the rig",
        "angle_random_walk and bias_instability",
        laboratory="warning",
    ),
    Check(
        "noise-figures-small",
        "chi-squared of the fit with its distribution",
        "99 % quantile: the noise figures are too small or the model is wrong; sigmas are enlarged",
        laboratory="warning",
    ),
    Check(
        "noise-figures-large",
        "chi-squared of the fit with its distribution",
        "1 % quantile: the noise figures are too large",
        laboratory="warning",
    ),
    Check(
        "scale-nonlinear",
        "straight line over the rates with cubic, asym+odd and free values",
        "p below 1 %",
        laboratory="warning",
    ),
    Check(
        "scale-one-sign",
        "signs of the table rates",
        "both signs: asymmetry needs them",
        laboratory="warning",
    ),
    Check(
        "scale-hysteresis",
        "readings after a lower rate with those after a higher one",
        "3 sigma",
        laboratory="warning",
    ),
    Check(
        "thermal-one-way",
        "heating with cooling in the logs",
        "both: one way does not separate drift from temperature",
        laboratory="warning",
    ),
    Check(
        "temperature-gap",
        "distance of neighbouring temperatures with the range",
        "40 % of the range: the curve is not tested there",
        laboratory="warning",
    ),
    Check(
        "thermal-hysteresis",
        "readings of heating with those of cooling",
        "p below 1 %",
        laboratory="warning",
    ),
    Check(
        "warm-up-unknown",
        "time constant of the warm-up with the record",
        "half the record, sigma of a factor 2",
        laboratory="warning",
    ),
    Check(
        "warm-up-not-over",
        "start of a still segment with the warm-up time",
        "warm-up time of the result",
        calibrate="warning",
    ),
    Check(
        "temperature-changes",
        "temperature over the segments",
        "1 degC: some 10 deg/h of a MEMS gyro",
        "warning",
    ),
)
