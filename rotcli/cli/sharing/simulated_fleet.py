"""`rotcli simulate --fleet`: results of a fleet with known variance components."""

from collections.abc import Mapping
from pathlib import Path

import click

from rotcli.cli import messages

MAX_RESULTS = 1_000_000


class Size(click.ParamType[tuple[int, int, int]]):
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


def simulate(
    numbers: tuple[int, int, int], output: str, quiet: bool, given: Mapping[str, object]
) -> None:
    """Write the results of a fleet into a folder; other options than the seed are usage errors."""
    wrong = [name for name, value in given.items() if value is not None and name != "seed"]
    if wrong:
        option = f"--{wrong[0].removesuffix('_path').replace('_', '-')}"
        raise click.UsageError(f"{option}: --fleet makes results, not logs; remove this option")

    from rotcli.errors import ResultError
    from rotcli.fleet.simulate import FleetSize, write_fleet

    folder = Path(output)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "truth.json").is_file():
        raise ResultError(
            f"{output}: exists and was not written by rotcli simulate; choose another folder"
        )
    size = FleetSize(*numbers)
    seed = given["seed"]
    write_fleet(output, size, seed if isinstance(seed, int) else 0)
    messages.say(f"{output}: {size.results} results of {size.units} units", quiet)
