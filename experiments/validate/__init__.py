"""The verification suite of the bed: cases with a known answer, run by `hedgebed validate`.

``suite.SUITE`` lists them; a family of cases is a module with ``CASES``.
"""
