"""The platform and the spike: geometry, mass, wheels, the rig, and files that describe a platform.

Of the other packages of `rigid` it imports only `checks`.

Imports `rigid.checks`.
"""
