"""The size of an error that the tests of a log find in half of the cases, for the profiles.

`python -m tests.campaigns.power` writes docs/evidence/power.md. Each case is a simulated run with
one error added to its logs, which calibrate or navigate examines completely; the size is found by
bisection over the share of seeds whose log gets the finding.
"""

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from rotcli.calibrate.api import calibrate_logs
from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.model import Column, Table
from rotcli.navigate.api import NavigateOptions, prepare_navigation
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.run.correction import correction_from_document
from rotcli.run.findings import CheckError
from rotcli.simulate.document import _rig
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG
from tests.campaigns.errors import (
    HALF_TURNING,
    WINDOW,
    Change,
    Run,
    accel_bias,
    accel_spike,
    bias,
    clock,
    copied,
    drift,
    eccentric,
    lag,
    leap,
    line,
    noise,
    ramp_step,
    repeated,
    scale,
    sine,
    spike,
    step,
    tilt,
    turning_step,
    zeros,
)

PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "power.md"
LOG = Path(__file__).parents[2] / "fixtures" / "nav440_rate_60" / "imu.parquet"
PROFILES, RATES = ("nav440", "mti-g"), (30.0, 100.0)
SEEDS = 12
_STEPS = 5  # of the bisection: 3 % of the size at most
_LARGEST = 1e6  # times the first size: beyond it the test does not find the error
_SITE = {
    "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0},
    "attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0},
}
# s and share of the rate: the runs of the papers, with a minute of navigation, and one that turns
# both ways, whose changes of the rate show a difference of the clocks.
MOTIONS = {
    "papers": ((60.0, 0.0, "static"), (60.0, 1.0, "rotation"), (60.0, 1.0, "navigation")),
    "both ways": (
        (60.0, 0.0, ""), (60.0, 1.0, ""), (60.0, 0.0, ""), (60.0, -1.0, ""), (30.0, 0.0, ""),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One error: test and error in words, command, codes that find it, unit, first size.

    counted: the size is a number of rows; any_rate: the table rate does not matter to it.
    """

    test: str
    error: str
    change: Change
    codes: tuple[str, ...]
    unit: str
    first: float
    command: str = "calibrate"
    motion: str = "papers"
    counted: bool = False
    any_rate: bool = False


@lru_cache(maxsize=200)
def made(profile: str, motion: str, rate: float, seed: int) -> Run:
    """Return a clean run; rate: deg/s."""
    w = rate * DEG
    legs = tuple(Leg(s, share * w, stage=name or None) for s, share, name in MOTIONS[motion])
    rig = rig_from_dict({**_SITE, "table": {"axis": "z"}})
    scenario = Scenario(read_profile(profile), legs, rig, seed=seed)
    result = simulate(scenario)
    # Results name the files of their logs, and look for temperatures there; these have none.
    imu, table = (replace(log, path=str(LOG)) for log in (result.imu, result.table))
    return Run(imu, table, rig_from_dict(_rig(scenario, result)), w)


@lru_cache(maxsize=200)
def correction(profile: str, rate: float, seed: int):
    """Return the calibration of the clean run."""
    run = made(profile, "papers", rate, seed)
    document = calibrate_logs(run.imu, run.table, run.rig).document
    return correction_from_document(document, "calibration")


def finds(case: Case, profile: str, rate: float, size: float, seed: int) -> bool:
    """Return whether the command reports the error of a size in the run of a seed."""
    run = made(profile, case.motion, rate, seed).copy()
    case.change(run, size)
    try:
        if case.command == "calibrate":
            findings = calibrate_logs(run.imu, run.table, run.rig).document["findings"]
        else:
            options = NavigateOptions(modes=("full",))
            known = correction(profile, rate, seed)
            prepared = prepare_navigation(run.imu, run.table, run.rig, known, options)
            findings = prepared.navigate("full").finish().document["findings"]
            findings += [found.to_dict() for found in prepared.runs["full"][0].findings]
    except CheckError as error:
        return error.code in case.codes
    return any(finding["code"] in case.codes for finding in findings)


def size_found(case: Case, profile: str, rate: float, seeds: int = SEEDS) -> float | None:
    """Return the size that is found in half of the seeds; None if no size is.

    Of rows, the smallest number that is found in half.
    """

    def half(size: float) -> bool:
        found = 0
        for seed in range(seeds):
            found += finds(case, profile, rate, size, seed)
            if 2 * found >= seeds or 2 * (seed + 1 - found) > seeds:  # decided
                break
        return 2 * found >= seeds

    low, high = 0.0, case.first
    while not half(high):
        low, high = high, 2.0 * high
        if high > _LARGEST * case.first:
            return None
    if case.counted:
        while high - low > 1.0:
            middle = float(round(0.5 * (low + high)))
            low, high = (low, middle) if half(middle) else (middle, high)
        return high
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if half(middle) else (middle, high)
    return 0.5 * (low + high)


def _cases() -> tuple[Case, ...]:
    halves = ("fit-contradicted", "mean-after-unexpected")
    fit, sines, nav = ("fit-contradicted",), ("residual-harmonics",), "navigate"
    rows, disturbed = ("samples-not-measured",), ("segment-disturbed",)
    both = "both ways"
    return (
        Case("fit-contradicted", "drift over the run", drift, fit, "deg/h", 100, any_rate=True),
        Case("fit-contradicted", "step in the middle of the still minute", step, fit, "deg/h", 50,
             any_rate=True),
        Case(", ".join(halves), "step in the middle of the turning minute", turning_step, halves,
             "deg/h", 50, any_rate=True),
        Case("residual-harmonics", "sine once per turn", sine(1), sines, "deg/h", 20),
        Case("residual-harmonics", "sine twice per turn", sine(2), sines, "deg/h", 20),
        Case("segment-disturbed", "mean over 0.25 s while turning", spike(HALF_TURNING, 25),
             disturbed, "deg/s", 0.1),
        Case("samples-not-measured", "rows of zeros", zeros, rows, "rows", 1,
             counted=True, any_rate=True),
        Case("samples-not-measured", "rows on a straight line", line, rows, "rows", 1,
             counted=True, any_rate=True),
        Case("copied-rows", "rows that repeat earlier ones", copied, ("copied-rows",), "rows", 1,
             counted=True, any_rate=True),
        Case("repeated-rows", "rows equal to the row before", repeated, ("repeated-rows",),
             "% of rows", 5, any_rate=True),
        Case("ramp-step", "bias that steps where the ramp begins", ramp_step, ("ramp-step",),
             "ppm", 1000),
        Case("table-angle, segment-rate", "leap of the table angle", leap,
             ("table-angle", "segment-rate"), "deg", 0.02),
        Case("encoder-eccentricity", "sine of the table angle in itself", eccentric,
             ("encoder-eccentricity",), "deg", 0.01),
        Case("scale-implausible", "scale factor", scale, ("scale-implausible",), "ppm", 1000),
        Case("noise-of-one-gyro, noise-figures", "noise of one gyro, above its own", noise,
             ("noise-of-one-gyro", "noise-figures"), "times", 0.5, any_rate=True),
        Case("clock-lag", "table stamps late", lag, ("clock-lag",), "ms", 1),
        Case("clock-rate", "table clock fast", clock, ("clock-rate", "clock-lag-large"), "ppm", 10,
             motion=both),
        Case("gyro-bias-changed", "gyro bias of the window", bias, ("gyro-bias-changed",),
             "deg/h", 20, nav),
        Case("accel-bias-changed", "accelerometer bias of the window", accel_bias,
             ("accel-bias-changed",), "m/s^2", 0.001, nav),
        Case("level-unexpected", "pitch of the rig", tilt, ("level-unexpected",), "deg", 0.01,
             nav),
        Case("window-disturbed", "one sample of a gyro", spike(WINDOW, 1), ("window-disturbed",),
             "deg/s", 0.2, nav),
        Case("window-disturbed", "one sample of an accelerometer", accel_spike,
             ("window-disturbed",), "m/s^2", 0.1, nav),
        Case("noise-unexpected", "noise of one gyro, above its own", noise, ("noise-unexpected",),
             "times", 0.5, nav, any_rate=True),
        Case("residual-harmonics", "sine once per turn", sine(1), sines, "deg/h", 10, nav),
    )  # fmt: skip


CASES = _cases()
COLUMNS = tuple((p, r) for p in PROFILES for r in RATES)


def shown(size: float | None) -> str:
    """Return a size as the page shows it.

    >>> shown(191.4), shown(1.0), shown(7812.5), shown(None)
    ('191', '1', '7810', 'not found')
    """
    return "not found" if size is None else f"{float(f'{size:.3g}'):g}"


def page(rows: list[tuple[str, ...]]) -> str:
    """Return the page."""
    names = [f"{p}, {r:g} deg/s" for p, r in COLUMNS]
    columns = (Column("finding"), Column("command"), Column("error"), *map(Column, names))
    table = Table("Size that is found in half of the cases", (*columns, Column("unit")), rows)
    return (
        "# Power of the tests of a log\n\nComputed by `python -m tests.campaigns.power`: simulated "
        "runs of the papers (a minute still, a minute turning, a minute of navigation) with one "
        f"error added to the logs of {SEEDS} seeds, and bisection over its size; of `clock-rate`, "
        "a run that turns both ways. `navigate` uses the calibration of the run without the error. "
        "Gyro x where a gyro is not named. A size of noise is what it exceeds its own by. What "
        "the tests are is in [checks of a calibration](../explanation/calibration-checks.md).\n\n"
        + to_markdown(table)
        + "\n"
    )


def row(case: Case) -> tuple[str, ...]:
    """Return the row of a case."""
    sizes = [
        "as at 30" if case.any_rate and r != RATES[0] else shown(size_found(case, p, r))
        for p, r in COLUMNS
    ]
    return (case.test, case.command, case.error, *sizes, case.unit)


def main() -> None:
    """Compute the sizes and write the page."""
    rows, begun = [], time.time()
    for case in CASES:
        rows.append(row(case))
        print(f"{time.time() - begun:.0f} s", rows[-1], flush=True)
    PAGE.write_text(page(rows))


if __name__ == "__main__":
    main()
