"""Checks of a calibration: one bias, one scale factor, plausible errors."""

from rotcli.run.check_table.row import Check

CHECKS: tuple[Check, ...] = (
    Check("one-rate", "rates of the segments", "0.1 % apart", "error"),
    Check(
        "fit-contradicted",
        "means of parts of the segments with one bias and one scale factor",
        "chi-squared, false alarms 0.1 %",
        "warning",
        observe="warning",
    ),
    Check(
        "residual-harmonics",
        "residuals with sines of the table angle, once and twice per turn",
        "chi-squared of 12 degrees of freedom, false alarms 0.1 %",
        "warning",
        "warning",
        "warning",
    ),
    Check(
        "mean-after-unexpected",
        "second halves of the segments with a calibration of the first halves",
        "chi-squared of three gyros, false alarms 0.1 %",
        "warning",
    ),
    Check(
        "scale-implausible",
        "scale factor and installation errors with scale_sigma of the rig",
        "10 times, and 4 sigma",
        "warning",
    ),
    Check("uneven-motion", "motion of the table with constant rates", "no two rates", "note"),
    Check(
        "no-slow-noise",
        "noise figures present in the rig",
        "bias_instability, rate_random_walk or a Gauss-Markov process",
        "warning",
    ),
)
