"""`python -m rotcli`, the same as the console script."""

from rotcli.cli.main import main

main()
