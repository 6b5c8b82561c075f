"""Cases of the verification suite on whole beds: silos, slopes, shear, plates, impacts.

Imports `dem`, `experiments.bed`, `experiments.calibrate`, `experiments.validate.base`,
`experiments.validate.measured`, `rigid`, `vis.page`.
"""

from vis.page.sentences import Sentences

say = Sentences(__package__)  # say("key", name=value): templates in sentences.toml
