"""Options of the command line that belong to the codes of findings."""

from rotcli.errors import RotcliError

_SEGMENT = "option: --static, --rotation or --window"
OPTIONS = {
    "segment-rate": _SEGMENT,
    "segment-records": _SEGMENT,
    "segment-outside": _SEGMENT,
    "segment-moving": _SEGMENT,
    "segment-overlap": "option: --static or --rotation",
    "still-segment-turns": "option: --static",
    "no-still-segment": "option: --static",
    "turning-segment-still": "option: --rotation",
    "no-turning-segment": "option: --rotation",
    "no-window": "option: --window",
    "window-samples": "option: --window",
    "averaging-times": "options: --taus, --window",
    "calibration-data-navigated": "options: --rotation of rotcli calibrate, --window",
    "calibration-rate": "option: --allow-other-rate",
    "calibration-rate-varies": "option: --window",
    "height-diverges": "option: --height hold",
    "log-size": "option: --max-bytes",
    "no-angle-random-walk": "options: --imu, --angle-random-walk, --rig",
    "no-noise-figures": "`rotcli allan --to-rig` writes them",
    "no-reliable-bias": "omit --save-calibration to see the estimates and the reasons",
    "no-scale-factor": "option: --mode partial",
    "no-still-record": "option: --window",
    "sensor-errors-assumed": "options: --imu, --accel-bias, --gyro-bias, --gyro-scale, "
    "--gyro-installation",
    "site-missing": "option: --rig",
    "smoothing-azimuth": "options: --smooth, --free-azimuth",
    "smoothing-history": "options: --update-rate, --window, --smooth",
    "still-segment-unused": "option: --static",
    "window-updates": "options: --window, --update-rate",
}


def with_option(finding: RotcliError | str) -> str:
    """Return the text of an error or a warning, with the option that belongs to its code."""
    option = OPTIONS.get(getattr(finding, "code", ""))
    return f"{finding} ({option})" if option else str(finding)
