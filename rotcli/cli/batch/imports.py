"""Modules that every run of a batch needs, imported once for all worker processes."""

import pyarrow.csv
import pyarrow.parquet  # noqa: F401

import rotcli.files.tables
import rotcli.logs.stream
import rotcli.logs.table
import rotcli.rig.rig
import rotcli.run.corrections  # noqa: F401
