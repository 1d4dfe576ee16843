"""A script that does with pyins what `rotcli navigate` does: read, integrate, compare, write.

Arguments: IMU log, output, start and end of the window (s), latitude, longitude (deg), height
(m), roll, pitch, heading (deg) of the sensor at the start of the window. Prints the largest error
of the height (m).
"""

import sys

import numpy as np
import pandas as pd
from pyins.strapdown import Integrator, compute_increments_from_imu
from pyins.transform import lla_to_ned
from pyins.util import TRAJECTORY_COLS


def main(log: str, output: str, *numbers: str) -> None:
    """Navigate the window and write trajectory and errors as Parquet."""
    start, end, latitude, longitude, height, *angles = map(float, numbers)
    imu = pd.read_parquet(log)
    imu.columns = [name.partition(" [")[0] for name in imu.columns]
    imu = imu.set_index("time").loc[start - 1e-3 : end + 1e-3]
    values = [latitude, longitude, height, 0.0, 0.0, 0.0, *angles]
    integrator = Integrator(pd.Series(values, index=TRAJECTORY_COLS, name=imu.index[0]))
    integrator.integrate(compute_increments_from_imu(imu, "increment"))
    way = integrator.trajectory
    errors = lla_to_ned(way[["lat", "lon", "alt"]], [latitude, longitude, height])
    way[["err_north", "err_east", "err_down"]] = np.asarray(errors)
    way.to_parquet(output, compression="zstd")
    print(float(np.abs(way["err_down"]).max()))


if __name__ == "__main__":
    main(*sys.argv[1:])
