"""What a body stands on: surface laws (`laws`), grounds made of them (`grounds`) and what they answer (`reaction`).

Imports `rigid.checks`.
"""
