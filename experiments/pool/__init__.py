"""Lists of runs, each in a folder of its own: in this process, in processes here, or on a cluster.

`together.run_all` carries out a list of `tasks.Task` for `calibrate`, `converge`, `experiments run`, `sweep` and
`validate`.

Imports `dem.prepare`, `experiments.runs`.
"""
