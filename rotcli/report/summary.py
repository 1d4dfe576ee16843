"""What a reader must know in ten seconds: which mode, how much better, at which rates."""

from collections.abc import Sequence

from rotcli.calibrate.campaign import calibration_runs, parameter_names
from rotcli.dataclass import dataclass
from rotcli.files.results.groups import (
    UNCALIBRATED,
    Group,
    Run,
    Source,
    device_label,
    grouped,
    mean,
    ratio,
)
from rotcli.navigate.campaign.tables import (
    comparable_windows,
    conventional_runs,
    groups_of_device,
    mean_position,
    navigation_runs,
)
from rotcli.units import digits

_CLOSE = 1.1  # a mode within 10 % of the best is no worse to speak of


@dataclass(frozen=True)
class ModeLine:
    """One mode of a unit: horizontal RMS in m and m/s, and how often it goes into conventional."""

    mode: str
    position: float
    velocity: float
    gain: float | None


@dataclass(frozen=True)
class Verdict:
    """The modes of one unit under test, and what they come to in one sentence."""

    label: str
    sentence: str
    modes: tuple[ModeLine, ...]
    best: str | None


def verdicts(sources: Sequence[Source]) -> list[Verdict]:
    """Return a verdict on each unit of the navigation results."""
    runs = navigation_runs(sources)
    groups = grouped(runs)
    turning = dict.fromkeys((g.imu, g.axis) for g in groups if g.mode != "conventional")
    alone = dict.fromkeys((g.imu, g.axis) for g in groups if g.imu not in {u for u, _ in turning})
    found = []
    for imu, axis in sorted({**turning, **alone}, key=lambda u: (u[0].casefold(), *u)):
        still = conventional_runs(runs, imu)
        chosen = {"conventional": grouped(still)} if still else {}
        for mode in (UNCALIBRATED, "partial", "full"):
            if members := groups_of_device(groups, imu, axis, mode):
                chosen[mode] = members
        everything = [run for members in chosen.values() for g in members for run in g.runs]
        like = comparable_windows(everything)
        level = mean([run.values["horizontal_m"] for run in still]) if like else None
        lines = tuple(_line(mode, members, level) for mode, members in chosen.items())
        best = min(lines, key=lambda line: line.position) if like and len(lines) > 1 else None
        label = device_label(imu, axis)
        sentence = _sentence(chosen, lines, best, level, everything[0].duration)
        if not like:
            sentence += " Windows of different length: the modes are not compared."
        found.append(Verdict(label, f"{label}: {sentence}", lines, best.mode if best else None))
    return found


def _line(mode: str, groups: Sequence[Group], level: float | None) -> ModeLine:
    position = mean_position(groups) or 0.0
    velocity = mean([group.mean("horizontal_mps") for group in groups]) or 0.0
    gain = None if mode == "conventional" else ratio(level, position)
    return ModeLine(mode, position, velocity, gain)


def _sentence(
    chosen: dict[str, list[Group]],
    lines: Sequence[ModeLine],
    best: ModeLine | None,
    level: float | None,
    duration: float,
) -> str:
    shown = best or lines[-1]
    size = f"{digits(shown.position)} m RMS over {duration:.0f} s"
    head = {
        "conventional": "standing still (conventional)",
        UNCALIBRATED: "turning without a calibration (conventional)",
        "partial": "turning with biases removed (partial)",
        "full": "turning with the full calibration (full)",
    }[shown.mode]
    text = f"{head}{' is best' if best else ''}: horizontal position error {size}"
    if shown.mode == "conventional" or level is None:
        if best and shown.mode == "conventional":
            nearest = min(line.position for line in lines if line is not shown)
            text += f"; turning gives {digits(nearest)} m or more"
        return text + "."
    gain = shown.gain or 0.0
    if gain >= 1.0:
        text += f", {digits(gain, 2)} times smaller than conventional ({digits(level)} m)"
    else:
        text += f", larger than conventional ({digits(level)} m)"
    close = [m for m in lines if m is not shown and m.position < _CLOSE * shown.position]
    behind = f"; {close[0].mode} is close behind ({digits(close[0].position)} m)" if close else ""
    groups = chosen[shown.mode]
    better = sum((group.mean("horizontal_m") or 0.0) < level for group in groups)
    low, high = digits(groups[0].rate), digits(groups[-1].rate)
    if len(groups) == 1:
        return f"{text}, at {low} deg/s{behind}."
    count = f"all {len(groups)}" if better == len(groups) else f"{better} of {len(groups)}"
    return f"{text}; smaller at {count} rates from {low} to {high} deg/s{behind}."


def calibration_sentences(sources: Sequence[Source]) -> list[str]:
    """Return how well each unit was calibrated, in a sentence."""
    runs = calibration_runs(sources)
    sentences = []
    for imu, axis in dict.fromkeys((g.imu, g.axis) for g in grouped(runs)):
        chosen = [run for run in runs if (run.imu, run.axis) == (imu, axis)]
        biases = _sigmas(chosen, "bias_")
        elements = _sigmas(chosen, "K")
        parts = [
            f"{what} to {_span(values)} {unit}"
            for what, values, unit in (
                ("gyro biases", biases, "deg/h"),
                ("scale factor and installation errors", elements, "ppm"),
            )
            if values
        ]
        if parts:
            count = f"{len(chosen)} calibration{'s' * (len(chosen) > 1)}"
            sentences.append(f"{device_label(imu, axis)}: {count}: {', '.join(parts)} (1 sigma).")
    return sentences


def _sigmas(runs: Sequence[Run], prefix: str) -> list[float]:
    values = [
        run.values[f"sigma {name}"]
        for run in runs
        for name in parameter_names(run)
        if name.startswith(prefix)
    ]
    return [value for value in values if value is not None]


def _span(values: Sequence[float]) -> str:
    least, most = digits(min(values), 2), digits(max(values), 2)
    return least if least == most else f"{least} to {most}"
