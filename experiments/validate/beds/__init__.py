"""Cases of the verification suite on whole beds: silos, slopes, shear, plates, impacts.

Imports `dem`, `experiments.bed`, `experiments.calibrate`, `experiments.validate.base`, `rigid`, `vis.page`.
"""
