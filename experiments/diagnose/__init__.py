"""Diagnose: where a model fails on measured trials, which effect it lacks, and how sure that is (docs/diagnose.md)."""
