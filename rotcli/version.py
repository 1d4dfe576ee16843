"""The version of rotcli."""

__version__ = "0.2.0"
