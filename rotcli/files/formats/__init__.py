"""Log formats of vendors and other programs, one class each; a new one is a line in `FORMATS`."""

from rotcli.files.formats.base import FRAMES, Column, Head, LogFormat
from rotcli.files.formats.euroc import Euroc
from rotcli.files.formats.increments import KfGins, Psins
from rotcli.files.formats.named_columns import ArduPilot, MicroStrain, Px4, Sbg
from rotcli.files.formats.novatel import NovAtel
from rotcli.files.formats.vectornav import VectorNav
from rotcli.files.formats.xsens import Xsens, XsensDot
from rotcli.files.formats.yei import ThreeSpace

__all__ = ["FORMATS", "FRAMES", "Column", "Head", "LogFormat", "find_format"]

# In the order in which a file is compared with them.
FORMATS: dict[str, LogFormat] = {
    entry.name: entry
    for entry in (
        XsensDot(),
        Xsens(),
        Euroc(),
        KfGins(),
        Psins(),
        VectorNav(),
        NovAtel(),
        MicroStrain(),
        Sbg(),
        ArduPilot(),
        Px4(),
        ThreeSpace(),
    )
}


def find_format(head: str) -> LogFormat | None:
    """Return the format that the first lines of a file are written in, None where unknown."""
    return next((entry for entry in FORMATS.values() if entry.is_format(head)), None)
