"""Checks of a navigation: errors and residuals with those that are expected."""

from rotcli.run.check_table.row import Check

CHECKS: tuple[Check, ...] = (
    Check(
        "rms-unexpected",
        "RMS errors of a navigation with those that the noise figures imply",
        "p of the run 1e-3: one clean run in a thousand",
        navigate="warning",
    ),
    Check(
        "gyro-bias-changed",
        "mean corrected gyro output of the window with its sigma",
        "p 1e-3, three axes",
        navigate="warning",
    ),
    Check(
        "accel-bias-changed",
        "accelerometers of the window with those of the still segment",
        "p 1e-3, three axes, at the table angle of the still segment",
        navigate="warning",
    ),
    Check(
        "level-unexpected",
        "level of the turning table from the accelerometers with [attitude]",
        "5 sigma, at least 0.02 deg; where gravity turns, a scale factor of 0.3 %",
        navigate="warning",
    ),
    Check(
        "window-disturbed",
        "means of a second of the window with the other seconds",
        "p 1e-3 of the largest residual of the window",
        navigate="warning",
    ),
    Check(
        "noise-unexpected",
        "scatter of the means of a second with the noise figures",
        "half to twice, p 1e-3 of six channels",
        navigate="warning",
    ),
)
