"""The version of rotcli."""

__version__ = "0.1.0"
