"""What every run of a batch needs, imported once for all worker processes."""

import pyarrow.csv
import pyarrow.parquet  # noqa: F401

import rotcli.cli.calibrate
import rotcli.cli.navigate
import rotcli.logs.stream
import rotcli.logs.table_log
import rotcli.results.calibration
import rotcli.results.navigation
import rotcli.results.tables
import rotcli.stages.calibrate
import rotcli.stages.navigate  # noqa: F401
