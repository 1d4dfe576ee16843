"""Modules that every run of a batch needs, imported once for all worker processes."""

import pyarrow.csv
import pyarrow.parquet  # noqa: F401

import rotcli.calibrate.api
import rotcli.cli.measure.calibrate
import rotcli.cli.navigation.navigate
import rotcli.files.tables
import rotcli.logs.stream
import rotcli.logs.table
import rotcli.navigate.api  # noqa: F401
