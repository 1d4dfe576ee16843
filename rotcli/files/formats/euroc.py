"""The EuRoC MAV dataset."""

from rotcli.files.formats.base import LogFormat, columns


class Euroc(LogFormat):
    """imu0/data.csv: the header line contains the units, the stamps are ns of Unix time."""

    name = "euroc"
    title = "EuRoC MAV dataset, imu0/data.csv"
    source = "Burri et al., The EuRoC micro aerial vehicle datasets, IJRR 2016"
    rig = {"columns": columns("timestamp", *(f"{s}_RS_S_{a}" for s in "wa" for a in "xyz"))}
