"""Files for other programs: estimators, autopilots, simulators and toolboxes.

`figures.collect` reads result documents into SI figures of one IMU, `numbers.prepare` applies the
rules (axes, random walk, inflation), and `formats.render` writes one format with its header.
"""
