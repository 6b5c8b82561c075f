"""What every experiment needs: the run folder, its result, settings, progress, and the list of experiments.

Imports `rigid.series`, and `vis` for reports; no other package of `experiments`.
"""
