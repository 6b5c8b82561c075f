"""Files of arrays: written whole or not at all, read back whole or refused.

Imports nothing of ours.
"""
