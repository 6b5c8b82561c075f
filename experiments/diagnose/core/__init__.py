"""What pushes and tumbles share in a diagnosis: the search over effects, the verdict, its words.

Imports `experiments.diagnose.fit`, `experiments.diagnose.noise`, `rigid`, `vis.page`.
"""
