"""The preparation of beds: stages, recipes, reports, the cache and bed files. Imports measure and what is below it."""
