"""Speed, memory and error of rotcli next to other programs, measured turn and turn about.

`python -m tests.campaigns.benchmarks` runs every group of rows and writes build/bench.json and
build/bench.md. A group is a function in one of the modules here that yields rows; `__main__` lists
them.
"""
