"""Films and stills of a run in the plane or in space: reels of frames, cameras, one sheet.

Imports `rigid`, `vis.page`, `vis.pictures`.
"""
