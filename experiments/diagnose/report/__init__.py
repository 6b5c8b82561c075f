"""What a diagnosis says: diagnosis.json, its summary and sentences.

Imports `experiments.campaign`, `experiments.diagnose.core`, `experiments.diagnose.fit`, `experiments.diagnose.noise`,
`experiments.runs`, `rigid`, `vis.diagnose`, `vis.page`.
"""
