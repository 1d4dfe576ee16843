"""Speed, memory and error of rotcli beside other programs, measured turn and turn about.

`python -m benchmarks` runs every group of rows and writes build/bench.json and build/bench.md. A
group is a function in one of the modules here that yields rows; `benchmarks.__main__` lists them.
"""
