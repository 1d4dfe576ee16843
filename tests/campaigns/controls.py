"""Clean runs through calibrate, navigate and observe: how often does each check warn of them?

`python -m tests.campaigns.controls --seeds 200` writes docs/evidence/controls.md. The runs are
those of the papers, shorter: still, turning, navigating at one rate, with the noise of a profile
and a rig that states it.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path

from rotcli.calibrate.api import calibrate_logs
from rotcli.errors import RotcliError
from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.model import Column, Table
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

PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "controls.md"
LOG = Path(__file__).parents[2] / "fixtures" / "nav440_rate_60" / "imu.parquet"
PROFILES, AXES, RATES = ("nav440", "mti-g"), ("z", "x", "y"), (30.0, -100.0, 10.0)
COMMANDS = ("calibrate", "navigate", "observe")
_STILL, _NAVIGATION = 30.0, 60.0  # s
_SEEDS_APART = 1000
_MIN_ROTATION, _TURN = 40.0, 380.0  # s; deg: a little more than a turn
_SITE = {
    "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0},
    "attitude": {"pitch": 0.0, "roll": 0.0, "azimuth": 0.0},
}


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


def alarms(profile: str, axis: str, rate: float, seed: int) -> dict[str, list[str]]:
    """Return the warnings (or the error) of each command about a clean run."""
    imu, table, rig = run(profile, axis, rate, seed)
    found: dict[str, list[str]] = {}
    try:
        calibration = calibrate_logs(imu, table, rig)
        found["calibrate"] = calibration.document["warnings"]
        correction = correction_from_document(calibration.document, "calibration")
        prepared = prepare_navigation(imu, table, rig, correction, NavigateOptions(modes=("full",)))
        found["navigate"] = prepared.navigate("full").finish().document["warnings"]
        found["observe"] = filter_logs(imu, table, rig, Options()).document["warnings"]
    except RotcliError as error:
        found["error"] = [str(error)]
    return {command: texts for command, texts in found.items() if texts}


def tally(profile: str, axis: str, rate: float, seeds: Iterable[int]) -> tuple[Counter, list[str]]:
    """Return how many runs each command warns of, and the warnings."""
    counts, texts = Counter(), []
    for seed in seeds:
        found = alarms(profile, axis, rate, seed)
        counts.update(found.keys())
        counts["any"] += bool(found)
        texts += [
            f"seed {seed}: {command}: {text}" for command, all in found.items() for text in all
        ]
    return counts, texts


def main() -> None:
    """Run all combinations and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, default=PAGE)
    given = parser.parse_args()
    rows, begun = [], time.time()
    for k, (profile, axis, rate) in enumerate(product(PROFILES, AXES, RATES)):
        first = given.first + _SEEDS_APART * k  # other noise in every row
        seeds = range(first, first + given.seeds)
        counts, texts = tally(profile, axis, rate, seeds)
        rows.append((profile, axis, rate, given.seeds, *(counts[c] for c in (*COMMANDS, "any"))))
        print(f"{time.time() - begun:.0f} s", rows[-1], counts["error"], flush=True)
        print(*texts, sep="\n", flush=True)
    names = ("profile", "axis", "rate, deg/s", "runs", *COMMANDS, "any")
    total = ("all", "", "", *(sum(row[k] for row in rows) for k in range(3, 8)))
    table = Table("Clean runs", tuple(Column(name) for name in names), [*rows, total])
    given.output.write_text(
        "# Clean runs\n\nRuns without a fault of which a command warns, by profile, axis and rate "
        f"(`python -m tests.campaigns.controls --seeds {given.seeds}`). Nominal: 0.1 % for each "
        "test, of which calibrate makes three (fit, harmonics, lag), navigate two more.\n\n"
        + to_markdown(table)
        + "\n"
    )


if __name__ == "__main__":
    main()
