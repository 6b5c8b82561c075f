"""The command line: `hedgebed <experiment>`, `resume`, `render`, `bench`, `doctor`.

Imports `dem`, `experiments.bed`, `experiments.campaign`, `experiments.fmu`, `experiments.penetrate`,
`experiments.runs`, `experiments.suite`, `experiments.tumble`, `rigid`, `vis`.
"""
