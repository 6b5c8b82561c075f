"""What a run on grains says while it goes on."""

from types import SimpleNamespace

from experiments.grains.following import follow


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

    def run(self, on_step, on_frame, frame_interval):
        for time in (0.5, 1.0, 1.5, 2.0):
            self.body.time = time
            on_step(self)
        self.placed = True
        on_step(self)
        return "found"

    def state(self):
        return {}


def test_a_hand_that_takes_longer_than_was_guessed_is_said_once():
    told = []
    progress = SimpleNamespace(stage=lambda *_, **__: None, update=lambda _: None, message=told.append)
    folder = SimpleNamespace(load_checkpoint=lambda _: None, save_checkpoint=lambda *_: None)
    found = follow(
        InAHand(), folder, progress, frames=lambda _: None, checkpoint_interval=60.0, sinkage=lambda: 0.0239,
        write_series=lambda: None,
    )  # fmt: skip
    assert found == "found"
    assert told == [
        "still in the hand that sets it down after 1.5 s: it is let go once it rests",
        "set down after 2 s: 23.9 mm deep",
    ]
