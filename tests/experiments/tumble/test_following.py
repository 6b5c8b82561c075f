"""What a run on grains says while it goes on."""

from types import SimpleNamespace

from golden import golden

from experiments.grains.following import Followed


class InAHand:
    """A run whose hand was guessed to take 1 s and lets go after 2."""

    def __init__(self):
        self.body = SimpleNamespace(time=0.0)
        self.master = SimpleNamespace(macro_step=0.5)
        self.placed, self.done, self.placing_steps, self.fraction = False, False, 4, 0.0
        self.ground = None

    @property
    def placement_is_long(self):
        return not self.placed and self.body.time > 1.0

    def run(self, on_step):
        for time in (0.5, 1.0, 1.5, 2.0):
            self.body.time = time
            on_step(self)
        self.placed = True
        on_step(self)
        return "found"

    def state(self):
        return {}


class Placed(Followed):
    """An experiment that draws nothing."""

    settings = SimpleNamespace(frame_count=0, checkpoint_interval=60.0)
    frames = write_series = conclude = None
    sinkage = staticmethod(lambda run: 0.0239)


def test_a_hand_that_takes_longer_than_was_guessed_is_said_once():
    told = []
    progress = SimpleNamespace(stage=lambda *_, **__: None, update=lambda _: None, message=told.append)
    folder = SimpleNamespace(path=None, load_checkpoint=lambda _: None, save_checkpoint=lambda *_: None)
    assert Placed().follow(InAHand(), folder, progress) == "found"
    golden("tumble/placement", told)
