"""What an engine does otherwise on a GPU: lists, loops and sums, a thread for each grain.

Imports `dem.contact`.
"""
