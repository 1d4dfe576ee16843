"""`rotcli simulate --fleet`: results of a fleet with known variance components."""

from pathlib import Path

import click

from rotcli.cli import messages
from rotcli.errors import ResultError
from rotcli.lazy import lazily

with lazily():
    from rotcli.fleet import simulate as fleet_simulate

MAX_RESULTS = 1_000_000


class Size(click.ParamType):  # type: ignore[type-arg]
    """A size of a fleet: units, days per unit, turn-ons per day."""

    name = "UNITS,DAYS,TURN-ONS"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int, int]:
        """Return the three numbers."""
        try:
            units, days, turns = (int(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not three numbers: units, days, turn-ons", param, ctx)
        if min(units, days, turns) < 1 or units * days * turns > MAX_RESULTS:
            self.fail(f"{value!r}: allowed are 1 to {MAX_RESULTS} results in all", param, ctx)
        return units, days, turns


def simulate(numbers: tuple[int, int, int], output: str, seed: int | None, quiet: bool) -> None:
    """Write the results of a fleet into a folder."""
    folder = Path(output)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "truth.json").is_file():
        raise ResultError(
            f"{output}: exists and was not written by rotcli simulate; choose another folder"
        )
    size = fleet_simulate.FleetSize(*numbers)
    fleet_simulate.write_fleet(output, size, seed or 0)
    messages.info(f"{output}: {size.results} results of {size.units} units", quiet)
