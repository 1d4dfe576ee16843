"""Load the logs of several turn-ons, as `scale` and `thermal` take them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading
from rotcli.lazy import lazily

with lazily():
    from rotcli.logs import temperature as thermometers
    from rotcli.run.laboratory import turn_on

if TYPE_CHECKING:
    from rotcli.run.laboratory.turn_on import TurnOn


def load_turn_ons(
    names: Sequence[str], rig_path: str | None, max_gap: int | None
) -> "list[TurnOn]":
    """Return the turn-ons of the arguments: pairs of logs, or one still IMU log."""
    if len(names) != 1 and len(names) % 2:
        raise click.UsageError("give pairs of logs, IMU_LOG TABLE_LOG, one per turn-on")
    pairs: list[tuple[str, str | None]] = [(names[0], None)]
    if len(names) > 1:
        pairs = list(zip(names[::2], names[1::2], strict=True))
    found = []
    for imu_log, table_log in pairs:
        rig = loading.load_rig(rig_path, imu_log)
        imu, table = loading.load_logs(imu_log, table_log, rig, max_gap)
        found.append(turn_on.TurnOn(imu, table, rig))
    return found


def with_temperature(run: "TurnOn", log: str | None) -> "TurnOn":
    """Return the turn-on with the temperature of its IMU log, or of a thermometer's log."""
    found = thermometers.read_temperature(run.imu, run.rig, log=log, **loading.byte_limit())
    return replace(run, temperature=found)
