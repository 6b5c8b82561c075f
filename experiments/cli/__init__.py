"""The command line: `hedgebed <experiment>`, `resume`, `render`, `bench`, `doctor`.

Imports `coupling.lammps`, `dem`, `experiments.bed`, `experiments.campaign`, `experiments.fmu`, `experiments.grains`,
`experiments.penetrate`, `experiments.pool`, `experiments.robot`, `experiments.runs`, `experiments.suite`,
`experiments.tumble`, `rigid`, `vis`.
"""
