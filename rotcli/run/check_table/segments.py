"""Checks of the segments and windows of a run."""

from rotcli.run.check_table.row import Check

CHECKS: tuple[Check, ...] = (
    Check(
        "segment-rate",
        "table angle of a named segment with a straight line",
        "resolution of the encoder, ripple of 1 ms times the rate",
        "error",
        "error",
    ),
    Check(
        "segment-records",
        "number of table records in a named segment",
        "10: a line through fewer shows no ramp",
        "error",
        "error",
    ),
    Check(
        "segment-outside",
        "named segment with the span of the logs",
        "0.1 s: logs may end a few samples before a round number",
        "error",
        "error",
    ),
    Check(
        "still-segment-turns",
        "table angle covered by the segment set as [stages] static",
        "0.01 deg, twice the resolution of the encoder, 1e-4 deg/s over the segment",
        "error",
        "error",
    ),
    Check(
        "turning-segment-still",
        "table angle covered by a segment set as [stages] rotation",
        "0.01 deg, twice the resolution of the encoder, 1e-4 deg/s over the segment",
        "error",
        "error",
    ),
    Check("no-still-segment", "still segments found", "5 s", "error", "error"),
    Check("no-turning-segment", "turning segments found", "5 s", "error", "error"),
    Check("no-window", "time that remains for navigation", "1 s", navigate="error"),
    Check("window-samples", "samples of the window", "4, of the quadrature", navigate="error"),
    Check(
        "segment-shortened",
        "named segment with the part of it at constant rate",
        "1 s: less is a ramp",
        "warning",
        "warning",
    ),
    Check(
        "table-coverage",
        "window with the span of the table log",
        "1 s",
        observe="warning",
    ),
    Check(
        "segment-turns",
        "table angle covered by a turning segment",
        "1 turn: uncompensated Earth rate averages out over full turns only",
        "warning",
    ),
    Check(
        "segment-overlap",
        "limits of the named segments with each other",
        "0.1 s: no sample may count twice",
        "error",
    ),
)
