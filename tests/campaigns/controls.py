"""Clean runs through calibrate, navigate and observe: how often does each check warn of them?

`python -m tests.campaigns.controls` writes docs/evidence/controls.md. The runs are those of the
papers, shorter: still, turning, navigating at one rate, with the noise of a profile and a rig that
states it. Besides 200 seeds of each profile, axis and rate, a table log that is 2 ms late, and one
whose clock is 30 ppm fast. The recorded Xsens log of `ROTCLI_SHARED` is a control too, in windows
of its still part; where it is absent, the page says so.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from rotcli.calibrate.api import calibrate_logs
from rotcli.errors import RotcliError
from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.model import Column, Table
from rotcli.models.numerics.chi_squared import exceeding_probability
from rotcli.navigate.api import NavigateOptions, prepare_navigation
from rotcli.observe.api import filter_logs
from rotcli.observe.zupt import Options
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.run.correction import correction_from_document
from rotcli.simulate.document import _rig
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG
from tests.recorded import SHARED, XSENS_COMPLETE_RIG, XSENS_LOG, write_xsens_still

PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "controls.md"
LOG = Path(__file__).parents[2] / "fixtures" / "nav440_rate_60" / "imu.parquet"
PROFILES, AXES, RATES = ("nav440", "mti-g"), ("z", "x", "y"), (10.0, 50.0, 100.0)
COMMANDS = ("calibrate", "navigate", "observe")
_STILL, _NAVIGATION = 30.0, 60.0  # s
_SEEDS_APART = 1000
_MIN_ROTATION, _TURN = 40.0, 380.0  # s; deg: a little more than a turn
_SITE = {
    "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0},
    "attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0},
}
_OBSERVED = 4  # every so many seeds: observe takes longer than the other two together
_LEVELS = (0.05, 0.01, 0.001)  # at the larger ones some thousand runs show whether p is uniform
_BAND = 0.99  # probability of the band around a nominal rate
_LAG_TAIL = 6.3e-5  # of 4 sigma, both sides; a third of a sample is required as well
_LEVEL_TAIL = 5.7e-7  # of 5 sigma, both sides
# Findings and their nominal rate per run. Those that are not listed: below one in a million.
NOMINAL = {
    ("calibrate", "fit-contradicted"): 1e-3,
    ("calibrate", "residual-harmonics"): 1e-3,
    ("calibrate", "mean-after-unexpected"): 1e-3,
    ("calibrate", "clock-lag"): _LAG_TAIL,
    ("navigate", "rms-unexpected"): 1e-3,
    ("navigate", "gyro-bias-changed"): 1e-3,
    ("navigate", "accel-bias-changed"): 1e-3,
    ("navigate", "window-disturbed"): 2e-3,  # gyros and accelerometers
    ("navigate", "noise-unexpected"): 1e-3,
    ("navigate", "level-unexpected"): _LEVEL_TAIL,
    ("navigate", "residual-harmonics"): 1e-3,
    ("navigate", "clock-lag"): _LAG_TAIL,
    ("observe", "fit-contradicted"): 1e-4,
    ("observe", "residual-harmonics"): 1e-3,
    ("observe", "clock-lag"): _LAG_TAIL,
}
# A finding of these asks for more than its statistic: a third of a sample, twice the noise, 0.02
# deg of tilt, or no other finding. Its rate is the nominal one at most.
AT_MOST = {
    ("calibrate", "mean-after-unexpected"),
    ("navigate", "noise-unexpected"),
    ("navigate", "level-unexpected"),
    *((command, "clock-lag") for command in COMMANDS),
}
RECORDED_LENGTH, RECORDED_WINDOWS = 10.0, (20.5, 30.5, 40.5)  # s, of the recorded log


@dataclass
class Tally:
    """What some runs gave: how many, warnings by command and code, p values by test."""

    runs: int = 0
    observed: int = 0
    warned: Counter = field(default_factory=Counter)
    codes: Counter = field(default_factory=Counter)
    p: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    texts: list[str] = field(default_factory=list)

    def add(self, seed: int, found: "Found") -> None:
        """Take one run."""
        self.runs += 1
        self.observed += found.observed
        self.warned.update(found.texts.keys())
        self.warned["any"] += bool(found.texts)
        self.codes.update(set(found.codes))
        for name, values in found.p.items():
            self.p[name] += values
        for command, texts in found.texts.items():
            self.texts += [f"seed {seed}: {command}: {text}" for text in texts]


@dataclass
class Found:
    """One run: texts of the warnings by command, (command, code) of findings, p values by test."""

    observed: bool = False
    texts: dict[str, list[str]] = field(default_factory=dict)
    codes: list[tuple[str, str]] = field(default_factory=list)
    p: dict[str, list[float]] = field(default_factory=dict)

    def add(self, command: str, document: dict[str, Any], findings: Iterable[Any]) -> None:
        """Take the warnings and findings of a command."""
        if document["warnings"]:
            self.texts[command] = document["warnings"]
        self.codes += [(command, f.code) for f in findings if f.severity != "note"]


def run(profile: str, axis: str, rate: float, seed: int):
    """Return IMU log, table log and rig of a clean run; rate: deg/s."""
    w, turn = rate * DEG, max(_MIN_ROTATION, _TURN / abs(rate))
    legs = (
        Leg(_STILL, stage="static"),
        Leg(turn, w, stage="rotation"),
        Leg(_NAVIGATION, w, stage="navigation"),
    )
    rig = rig_from_dict({**_SITE, "table": {"axis": axis}})
    scenario = Scenario(read_profile(profile), legs, rig, seed=seed)
    made = simulate(scenario)
    # Results name the files of their logs, and look for temperatures there; these have none.
    imu, table = (replace(log, path=str(LOG)) for log in (made.imu, made.table))
    return imu, table, rig_from_dict(_rig(scenario, made))


def late(table):
    """Return a table log that is 2 ms late."""
    return replace(table, time=table.time + 2e-3)


def fast(table):
    """Return a table log whose clock is 30 ppm fast."""
    return replace(table, time=table.time[0] + (table.time - table.time[0]) * (1.0 + 30e-6))


def examine(imu, table, rig, *, observe: bool) -> Found:
    """Return warnings, findings and p values of the commands; an error is one too."""
    found = Found()
    try:
        calibration = calibrate_logs(imu, table, rig)
        doc, estimate = calibration.document, calibration.estimate
        found.add("calibrate", doc, estimate.findings)
        found.p["calibrate: fit, each gyro"] = [
            exceeding_probability(test.chi2, test.dof) for test in estimate.test.gyros
        ]
        sines = estimate.test.harmonics
        if sines is not None:
            p = exceeding_probability(sines.chi2, sines.dof)
            found.p["calibrate: sines of the table angle"] = [p]
        after = estimate.limit_tests["mean_after"]
        if after is not None:
            p = exceeding_probability(after.value, 3)
            found.p["calibrate: second halves of the segments"] = [p]
        correction = correction_from_document(doc, "calibration")
        options = NavigateOptions(modes=("full",))
        result = prepare_navigation(imu, table, rig, correction, options).navigate("full").finish()
        verdict, tests = result.assessment.verdict, result.assessment.expectation.tests
        found.add("navigate", result.document, verdict.findings)
        found.p["navigate: RMS of the run, seven times the smallest p"] = [verdict.p_run]
        for name, test in (
            ("mean of the gyros", tests.gyro_mean),
            ("mean of the accelerometers", tests.accel_mean),
            ("seconds of the gyros", tests.gyro_blocks),
            ("seconds of the accelerometers", tests.accel_blocks),
        ):
            if test is not None:
                found.p[f"navigate: {name}"] = [test.p_value]
        sines = result.assessment.harmonics
        if sines is not None:
            p = exceeding_probability(sines.chi2, sines.dof)
            found.p["navigate: sines of the table angle"] = [p]
        if not observe:
            return found
        found.observed = True
        observed = filter_logs(imu, table, rig, Options())
        found.add("observe", observed.document, observed.filtered.findings)
    except RotcliError as error:
        found.texts["error"] = [str(error)]
    return found


def tally(
    profile: str, axis: str, rate: float, seeds: Iterable[int], change: Callable | None = None
) -> Tally:
    """Return what clean runs of seeds give; change: of the table log, that must not matter."""
    result = Tally()
    for seed in seeds:
        imu, table, rig = run(profile, axis, rate, seed)
        table = table if change is None else change(table)
        result.add(seed, examine(imu, table, rig, observe=seed % _OBSERVED == 0))
    return result


def band(count: int, nominal: float) -> tuple[int, int]:
    """Return the band of a number of events out of `count` at a nominal rate."""
    low, high = stats.binom.interval(_BAND, count, nominal)
    return int(low), int(high)


def finding_rows(total: Tally) -> list[tuple]:
    """Return a row for each finding: how often it came, and how often it should."""
    keys = sorted({*NOMINAL, *total.codes})
    rows = []
    for key in keys:
        nominal, seen = NOMINAL.get(key, 1e-6), total.codes[key]
        runs = total.observed if key[0] == "observe" else total.runs
        low, high = band(runs, nominal)
        bounded = key in AT_MOST or key not in NOMINAL
        rate = f"{'at most ' if bounded else ''}{100.0 * nominal:.2g} %"
        low = 0 if bounded else low
        within = "yes" if low <= seen <= high else "no"
        rows.append((*key, runs, rate, seen, f"{low} to {high}", within))
    return rows


def level_rows(total: Tally) -> list[tuple]:
    """Return a row for each p value: how many are below each level, with their bands."""
    rows = []
    for name, values in total.p.items():
        p = np.array([v for v in values if v is not None])
        cells: list[Any] = [name, len(p)]
        for level in _LEVELS:
            low, high = band(len(p), level)
            cells += [int(np.count_nonzero(p < level)), f"{low} to {high}"]
        rows.append(tuple(cells))
    return rows


def recorded() -> tuple[int, list[str]]:
    """Return how many commands ran on the still recorded log, and their warnings."""
    if not SHARED.joinpath(*XSENS_LOG).exists():
        return 0, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = write_xsens_still(folder)
        (folder / "rig.toml").write_text(XSENS_COMPLETE_RIG)
        lines = [["allan", log], ["inspect", log]]
        for start in RECORDED_WINDOWS:
            window = f"{start}:{start + RECORDED_LENGTH}"
            still = f"{start - 2.0 * RECORDED_LENGTH}:{start}"
            lines.append(["navigate", log, "--static", still, "--window", window])
            window = f"{start - 2.0 * RECORDED_LENGTH}:{start + RECORDED_LENGTH}"
            lines.append(["observe", log, "--window", window, "--sigma-gyro", "10000"])
        said = []
        for line in lines:
            done = subprocess.run(
                [sys.executable, "-m", "rotcli", *map(str, line)],
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode or done.stderr:
                said.append(f"{line[0]}: {done.stderr.strip()}")
        return len(lines), said


def page(by_run: list[tuple], total: Tally, seeds: int, real: tuple[int, list[str]]) -> str:
    """Return the page; real: of `recorded`."""
    names = ("profile", "axis", "rate, deg/s", "table log", "runs", *COMMANDS, "any")
    sums = [sum(row[k] for row in by_run) for k in range(4, 9)]
    runs = Table(
        "Runs with a warning", tuple(map(Column, names)), [*by_run, ("all", *[""] * 3, *sums)]
    )
    heads = ("command", "finding", "runs", "nominal", "found", "99 % band", "within")
    found = Table("Findings", tuple(map(Column, heads)), finding_rows(total))
    heads = ("test", "figures")
    for k, level in enumerate(_LEVELS):
        heads += (f"p below {100.0 * level:g} %", "99 % band" + " " * k)
    level = Table("Level of each test", tuple(map(Column, heads)), level_rows(total))
    share = 100.0 * (1.0 - sums[-1] / sums[0])
    count, said = real
    log = f"{count} commands on the still part of a recorded Xsens MTi: {len(said)} with a warning."
    return (
        "# Clean runs\n\nRuns without a fault of which a command warns (`python -m "
        f"tests.campaigns.controls --seeds {seeds}`): 30 s still, 40 s turning, 60 s of navigation "
        "at the same rate; `observe` on every fourth of them. "
        f"{share:.2f} % of all runs are silent. "
        + (log if count else "The recorded log was absent.")
        + "\n\n"
        + to_markdown(runs)
        + f"\n\nThe findings of the {total.runs} runs with an unchanged table log. The band "
        "contains 99 % of the counts at the nominal rate of a run. The rate is at most the nominal "
        "one where a finding asks for more than its statistic.\n\n"
        + to_markdown(found)
        + "\n\nThe p value behind each test in the same runs. Below 5 and 1 % it shows the level "
        "with better statistics than the alarms do. That of the RMS is an upper bound: seven times "
        "the smallest of eleven p is near its level at 0.1 % and above it at 5 %.\n\n"
        + to_markdown(level)
        + "\n"
    )


def main() -> None:
    """Run all combinations and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, default=PAGE)
    given = parser.parse_args()
    plan = [(*each, "as it is", None) for each in product(PROFILES, AXES, RATES)]
    plan += [(p, "z", 50.0, "2 ms late", late) for p in PROFILES]
    plan += [(p, "z", 50.0, "30 ppm fast", fast) for p in PROFILES]
    by_run, total, changed, begun = [], Tally(), Tally(), time.time()
    real = recorded()
    print(*real, flush=True)
    for k, (profile, axis, rate, name, change) in enumerate(plan):
        first = given.first + _SEEDS_APART * k  # other noise in every row
        part = tally(profile, axis, rate, range(first, first + given.seeds), change)
        counts = [part.warned[c] for c in (*COMMANDS, "any")]
        by_run.append((profile, axis, rate, name, part.runs, *counts))
        print(f"{time.time() - begun:.0f} s", by_run[-1], part.warned["error"], flush=True)
        print(*part.texts, sep="\n", flush=True)
        into = total if change is None else changed
        into.runs += part.runs
        into.observed += part.observed
        into.codes.update(part.codes)
        for test, values in part.p.items():
            into.p[test] += values
        given.output.write_text(page(by_run, total, given.seeds, real))


if __name__ == "__main__":
    main()
