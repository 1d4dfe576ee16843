"""The rows of the table of checks, one module per subject; joined in `rotcli.run.checks`."""
