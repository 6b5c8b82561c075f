"""Frames, pictures, plots and the report of a run folder.

Reads and writes run folders (docs/architecture.md) and plain arrays; imports nothing of `dem`, `rigid`, `coupling` or
`experiments`. A picture can thus be made again, elsewhere, years later. Import from the modules:

`vis.frames` (VTU and PVD), `vis.meshes` (triangle meshes), `vis.pictures` (off-screen pictures and the animation),
`vis.plots` (curves), `vis.report` (`report.html`).
"""
