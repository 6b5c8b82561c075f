"""Pictures of grains and bodies by PyVista, off screen, and the frames that they are drawn from.

Imports `rigid`, `vis.page`.
"""
