"""`rotcli` and `python -m rotcli`: from the first import on an interrupt is one line."""

import sys
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line; see `rotcli.cli.main`."""
    try:
        from rotcli.cli.main import main as run

        run()
    except KeyboardInterrupt:  # while importing, or after the command was done
        sys.stderr.write("rotcli: interrupted; nothing was left half-written\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
