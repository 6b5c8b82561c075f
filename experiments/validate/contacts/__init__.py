"""Cases of the verification suite on single contacts and clouds of grains.

Imports `dem`, `experiments.runs`, `experiments.validate.base`, `vis.page`.
"""

from vis.page.sentences import Sentences

say = Sentences(__package__)  # say("key", name=value): templates in sentences.toml
