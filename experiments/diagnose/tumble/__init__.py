"""Diagnosis of tumbles of a platform.

Imports `experiments.campaign`, `experiments.check`, `experiments.diagnose.core`, `experiments.diagnose.fit`,
`experiments.diagnose.noise`, `rigid`.
"""
