"""The page that every report is: sections, tables, figures, sentences, the style.

Imports `rigid`.
"""
