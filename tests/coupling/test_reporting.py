"""What a run reports to, how it describes itself, and names that have changed."""

import warnings

import pytest
from fake_bed import FakeBed

import coupling
from coupling import BedGround, CoupledTumble, Drive, Ground, LawGround, Master, PlanarBody, drive
from rigid import Spike, SpringDamper, SurfaceGround, Trial, find_platform

TRIAL = Trial(gravity_sim=0.0834, counterweight=5.2, torque=0.2)


class Bar:
    """A progress bar that keeps what it was given."""

    def __init__(self):
        self.seen = []

    def update(self, fraction):
        self.seen.append(fraction)


def test_progress_rises_to_one_and_every_reporter_sees_every_step():
    bar, first, second = Bar(), [], []
    found = drive(
        Spike(), into=SpringDamper(stiffness=1e4), speed=0.1, depth=0.01, progress=bar,
        on_step=[lambda run: first.append(run.count), lambda run: second.append(run.depth)],
    )  # fmt: skip
    assert first == list(range(1, len(found.time) + 1)) and len(second) == len(bar.seen) == len(first)
    assert bar.seen == sorted(bar.seen) and bar.seen[-1] == 1.0


def test_reporters_can_be_appended_to_a_run():
    run, steps, frames = CoupledTumble(TRIAL, LawGround.of_trial(TRIAL), duration=0.05), [], []
    run.reporters.append(lambda run: steps.append(run.time))
    run.frame_reporters.append(lambda run: frames.append(run.time))
    run.run(frame_interval=0.01, on_frame=lambda run: None)
    assert len(steps) == 50 and len(frames) == run.frames_taken == 6


@pytest.mark.parametrize(
    "ground", [SpringDamper(stiffness=1e4), SurfaceGround(law="bekker"), LawGround.of_trial(TRIAL),
               BedGround(FakeBed(), Spike())],
)  # fmt: skip
def test_every_ground_has_the_one_contract(ground):
    assert isinstance(ground, Ground)
    assert "\n" not in repr(ground)


def test_a_repr_says_what_a_thing_is_with_units():
    master = Master(PlanarBody(TRIAL, z=0.2), LawGround.of_trial(TRIAL))
    run = Drive(Spike(diameter=0.024), SpringDamper(stiffness=1e4), speed=0.1, depth=0.01)
    for thing, part in {
        Spike(diameter=0.024): "24 mm", TRIAL: "0.0834 m/s2", find_platform("hedgehog"): "5.3 kg",
        SpringDamper(stiffness=1e4): "10000 N/m", master: "0.001 s", master.body: "0.2 m", run: "24 mm",
    }.items():  # fmt: skip
        assert part in repr(thing) and "\n" not in repr(thing)


@pytest.mark.parametrize(
    ("old", "new"), [("Footing", "Ground"), ("LawFooting", "LawGround"), ("BedFooting", "BedGround")]
)
def test_old_names_go_on_with_a_warning(old, new):
    with pytest.warns(DeprecationWarning, match=new):
        assert getattr(coupling, old) is getattr(coupling, new)


def test_old_attributes_go_on_with_a_warning():
    master = Master(PlanarBody(TRIAL, z=0.2), LawGround.of_trial(TRIAL))
    with pytest.warns(DeprecationWarning, match="exchange"):
        assert master.books is master.exchange
    with pytest.warns(DeprecationWarning, match="in_placement"):
        assert master.body.held_by_hand is False
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        master.step()
