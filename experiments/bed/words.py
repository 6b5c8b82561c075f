"""The sentences of `bed`: ``say("key", name=value)``, templates in sentences.toml."""

from vis.page.sentences import Sentences

say = Sentences(__package__)
