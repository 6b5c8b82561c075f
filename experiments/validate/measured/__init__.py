"""Cases of the verification suite that hold the bed against measured experiments: plates in sand, drops of balls.

Imports `dem`, `experiments.runs`, `experiments.validate.base`, `vis.page`.
"""

from vis.page.sentences import Sentences

say = Sentences(__package__)  # say("key", name=value): templates in sentences.toml
