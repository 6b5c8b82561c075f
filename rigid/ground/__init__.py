"""What a body stands on: surface laws (`laws`), grounds made of them (`grounds`) and what they answer (`reaction`).

Imports nothing of the other packages of `rigid`.
"""
