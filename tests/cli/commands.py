"""The commands of rotcli, those of groups by their full names."""

import click

from rotcli.cli.main import COMMANDS, LazyGroup


def leaf_commands() -> list[tuple[str, click.Command]]:
    """Return (name, command) of every command; `srins calibrate` for one of a group."""
    leaves: list[tuple[str, click.Command]] = []
    for name in COMMANDS:
        command = LazyGroup().get_command(None, name)
        if isinstance(command, click.Group):
            leaves += [(f"{name} {sub}", found) for sub, found in command.commands.items()]
        else:
            leaves.append((name, command))
    return leaves
