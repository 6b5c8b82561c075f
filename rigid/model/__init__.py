"""The planar model as a sum of terms: a trial's numbers (`trial`), and functions that its terms make up (`model`).

Imports `rigid.checks`, `rigid.ground`, `rigid.terms`.
"""
