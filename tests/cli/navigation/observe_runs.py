"""The command line, and the logs of a run, for the tests of `rotcli observe`."""

import pytest

from rotcli.cli.main import main


def rotcli(capsys, *args):
    """Run the command line; return exit status, standard output and standard error."""
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in args])
    out, err = capsys.readouterr()
    return stop.value.code, out, err


def logs(run):
    return run / "imu.parquet", run / "table.parquet"
