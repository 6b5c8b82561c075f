"""One planar trial, integrated accurately (`located`) or as the paper does (`paper`); `simulate` is the entry.

Imports `rigid.checks`, `rigid.model`, `rigid.terms`.
"""
