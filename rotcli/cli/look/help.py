"""`rotcli help`: reference pages that are installed with the package."""

import click

from rotcli.cli import options
from rotcli.dataclass import dataclass
from rotcli.files.installed import DATA

# Topic: content. The pages are rotcli/data/help/TOPIC.md.
TOPICS = {
    "rig": "rig.toml and scenario files, key by key",
    "results": "result documents (JSON) and time series, key by key",
    "checks": "checks of logs and results: code, commands, severity",
}


@dataclass(frozen=True)
class HelpCommand:
    """Options of `rotcli help`."""

    topic: str | None
    quiet: bool


@click.command(epilog=options.example("rotcli help rig"))
@click.argument("topic", required=False, type=click.Choice(list(TOPICS)))
@options.messages
@options.collect(HelpCommand)
def command(given: HelpCommand) -> None:
    """Print a reference page: rig, results or checks.

    Without TOPIC the topics are listed.
    """
    if given.topic is None:
        for topic, text in TOPICS.items():
            click.echo(f"{topic:8}  {text}")
        return
    page = DATA / "help" / f"{given.topic}.md"
    click.echo(page.read_text(encoding="utf-8"), nl=False)
