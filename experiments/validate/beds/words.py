"""The sentences of the cases of this package: ``say("key", name=value)``, templates in sentences.toml."""

from vis.page.sentences import Sentences

say = Sentences(__package__)
