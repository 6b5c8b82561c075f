"""What a body stands on: surface laws (`laws`), grounds made of them (`grounds`) and what they answer (`reaction`).

Of the other packages of `rigid` it imports only `checks`.

Imports `rigid.checks`.
"""
