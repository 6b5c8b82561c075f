"""The engine on a GPU: its lists, loops and sums, a thread for each grain.

Imports `dem.contact`, `dem.engine`.
"""
