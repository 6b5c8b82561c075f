"""Preparation and its cache: rain, level, settle; the same seed gives the same bits; what cannot be made is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import dem.prepare.laboratory
import dem.prepare.prepare
import dem.prepare.stages
from dem import SAND_WEAK, Bed, Facing, LogNormal, Normal, Uniform
from dem.prepare.laboratory import Laboratory
from dem.prepare.prepare import check_options, prepare_bed
from dem.prepare.recipe import Stage, check_stages, parse_stage
from dem.prepare.report import ENERGY_RATIO
from dem.prepare.specification import Specification
from dem.prepare.stages import Preparation

GRAIN = 0.004
BED = {"size": (0.024, 0.024, 0.03), "grain": GRAIN, "seed": 3}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small bed, as it came out of its preparation: the bed, its state, the cache it left."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEDGEBED_CACHE", str(folder))
        bed = Bed.prepare(SAND_WEAK, **BED)
    return bed, bed.state(), folder


@pytest.fixture
def bed(made):
    """The bed, back in the state in which it was prepared."""
    made[0].restore(made[1])
    return made[0]


def same(a, b):
    return a.keys() == b.keys() and all(a[k].tobytes() == b[k].tobytes() for k in a)


def test_a_prepared_bed_is_at_rest_and_level(bed):
    """Mean kinetic energy below 1e-5 m g d, floor force within 1 % of the weight, no grain above the level."""
    assert bed.time == 0 and bed.max_overlap == 0 and np.abs(bed.grains().displacement).max() == 0
    unit = bed.weight / bed.grain_count * GRAIN
    assert bed.kinetic_energy / bed.grain_count < ENERGY_RATIO * unit
    assert bed.floor_force == pytest.approx(bed.weight, rel=0.01)
    bed.advance(round(0.05 / bed.time_step))
    assert bed.kinetic_energy / bed.grain_count < 3 * ENERGY_RATIO * unit
    assert bed.floor_force == pytest.approx(bed.weight, rel=0.01)
    grains = bed.grains()
    assert (grains.position[:, 2] <= 0.03 * 1.01).all() and (grains.position[:, 2] > 0).all()
    assert 0.027 < bed.surface < 0.0305
    assert 0.53 < bed.packing_fraction < 0.64
    assert 3.5 < bed.coordination_number < 6.5
    assert 0 < bed.max_overlap < 0.01  # at rest, far below the bound
    assert (np.abs(grains.radius * 2 / GRAIN - 1) <= 0.15).all()
    assert bed.material.young < SAND_WEAK.young and bed.seed == 3


@pytest.mark.long
def test_rain_may_land_harder_than_the_bound_of_the_bed_it_makes(monkeypatch):
    """A fall of 30 mm on the floor: Hertz (softening.py, 4) gives 2 % of a diameter at 20 MPa; then 1 % rules."""
    landed = []
    level = Laboratory._level
    look = lambda work, stage: landed.append(work.bed.max_overlap) or level(work, stage)  # noqa: E731
    monkeypatch.setattr(Laboratory, "_level", look)
    given = {"size": (0.02, 0.02, 0.012), "grain": 0.003, "seed": 1, "max_overlap": 0.01, "young": 2e7}
    bed = prepare_bed("sand-weak", **given, cache=False)
    assert 0.01 < landed[0] < 0.05
    assert bed.overlap_limit == 0.01 and bed.max_overlap == 0


class Progress:
    """Keeps what it is told."""

    def __init__(self):
        self.stages, self.shares, self.grain_steps = [], [], []

    def show_bed(self, bed):
        self.grain_steps.append(bed.grain_steps)

    def stage(self, name, total):
        self.stages.append(name)

    def update(self, done):
        self.shares.append(done)


class Stop(Exception):  # noqa: N818
    """Ends a preparation where a test has seen enough."""


def stop(*_):
    raise Stop


def test_the_same_seed_gives_the_same_bits_and_progress_is_told(made):
    progress = Progress()
    again = prepare_bed("sand-weak", **BED, cache=False, progress=progress)
    assert same(again.state(), made[1])
    assert progress.stages == ["rain", "settle"]
    assert len(progress.shares) > 4 and all(0 <= share <= 1 for share in progress.shares)
    assert len(progress.grain_steps) == len(progress.shares) and max(progress.grain_steps) > 0


def test_another_seed_rains_other_grains(monkeypatch):
    rained = []
    monkeypatch.setattr(Laboratory, "run", lambda work: rained.append(work.bed.grains().as_dict()) or stop())
    for seed in (3, 4):
        with pytest.raises(Stop):
            prepare_bed("sand-weak", **BED | {"seed": seed}, cache=False)
    for name in ("radius", "position"):
        assert not np.isclose(rained[0][name], rained[1][name], rtol=1e-9).any()


def test_a_cached_bed_is_the_bed_to_the_bit_and_needs_no_making(made, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(made[2]))
    monkeypatch.setattr(Specification, "rain", lambda *_: pytest.fail("it was made anew"))
    bed = prepare_bed(SAND_WEAK, **BED)
    assert same(bed.state(), made[1])
    for name in ("surface", "packing_fraction", "size", "gravity", "time_step", "seed", "material", "overlap_limit"):
        assert getattr(bed, name) == getattr(made[0], name), name
    assert bed.material.sources == SAND_WEAK.sources
    (kept,) = (made[2] / "beds").glob("*.json")
    assert json.loads(kept.read_text())["grain"] == GRAIN


@pytest.mark.parametrize("damage", [b"", b"no bed", None])
def test_a_damaged_file_in_the_cache_is_said_and_made_anew(made, monkeypatch, tmp_path, damage):
    (file,) = (made[2] / "beds").glob("*.npz")
    whole = file.read_bytes()
    here = tmp_path / "cache" / "beds" / file.name
    here.parent.mkdir(parents=True)
    here.write_bytes(whole[: len(whole) // 3] if damage is None else damage)
    monkeypatch.setattr(Specification, "rain", stop)
    with pytest.warns(UserWarning, match="cannot be read and is made anew"), pytest.raises(Stop):
        prepare_bed(SAND_WEAK, **BED)


def test_the_key_of_the_cache_holds_every_option(monkeypatch):
    """Each option that shapes a bed gives another file; threads, and whether there is progress, do not."""
    asked = []

    class NoBed:
        size = BED["size"]
        packing_fraction = 0.6
        grain_count = 1

        def measure_surface(self):
            pass

        def mark_origin(self):
            pass

        def save(self, path):
            asked.append(path.name)
            path.parent.mkdir(parents=True, exist_ok=True)

    monkeypatch.setattr(Specification, "rain", lambda *_: NoBed())
    monkeypatch.setattr(Laboratory, "run", lambda work: work.bed)
    monkeypatch.setattr(dem.prepare.prepare.runtime, "start", lambda **_: None)

    def name_of(material=SAND_WEAK, **options):
        prepare_bed(material, **BED | {"young": 1e7} | options)
        return asked[-1]

    plain = name_of()
    assert name_of() == plain and name_of("SAND-WEAK") == plain
    assert name_of(threads=1) == plain
    numbers = {"density": 2600, "poisson": 0.2, "friction": 0.4, "restitution": 0.6, "rolling_friction": 0.2}
    others = [name_of(replace(SAND_WEAK, **{key: value})) for key, value in numbers.items()]
    others += [
        name_of(replace(SAND_WEAK, cohesion=law, surface_energy=g))
        for law, g in (("dmt", 1.0), ("jkr", 1.0), ("jkr", 2.0))
    ]
    others += [name_of(grain=grain) for grain in (Normal(GRAIN, 0.1), Normal(GRAIN, 0.2), LogNormal(GRAIN, 0.1))]
    others += [
        name_of(**{key: value})
        for key, value in {
            "size": (0.024, 0.024, 0.031),
            "grain": 0.0039,
            "spread": 0.1,
            "packing": 0.6,
            "gravity": 1.62,
            "seed": 2,
            "young": 2e7,
            "max_overlap": 0.01,
            "time_step": 1e-6,
            "floor": Facing(friction=0.2),
            "precision": "float32",
            "arch": "cuda",
        }.items()
    ]
    assert len({plain, *others}) == 1 + len(others)
    before = len(asked)
    prepare_bed(SAND_WEAK, **BED, cache=False)
    assert len(asked) == before


@pytest.fixture
def already_rained(bed, monkeypatch):
    """Preparation starts from the bed at rest, so that tapping alone is tested."""
    monkeypatch.setattr(Specification, "rain", lambda *_: bed)
    monkeypatch.setattr(Laboratory, "_rain_down", lambda work, stage: {})
    monkeypatch.setattr(Laboratory, "_level", lambda work, stage: work._settle(ENERGY_RATIO, {}) or {})
    return bed.packing_fraction


def test_a_bed_is_tapped_to_the_packing_asked_for(already_rained):
    wanted = already_rained + 0.004
    bed = prepare_bed(SAND_WEAK, **BED, packing=wanted, cache=False)
    assert wanted - 0.0005 <= bed.packing_fraction < wanted + 0.01
    assert bed.floor_force == pytest.approx(bed.weight, rel=0.01)
    assert bed.time == 0 and bed.gravity == (0.0, 0.0, -9.81)


@pytest.mark.parametrize(
    ("packing", "words"),
    [(0.501, r"rains in at 0\.\d+ and loosened from below still lies"), (0.64, "1 taps brought the bed")],
)
def test_a_packing_out_of_reach_is_refused(already_rained, monkeypatch, packing, words):
    """Looser than the rain, and denser than tapping makes it."""
    monkeypatch.setattr(dem.prepare.stages, "_MOST_TAPS", 1)
    with pytest.raises(ValueError, match=rf"packing = {packing} cannot be reached: .*{words}"):
        prepare_bed(SAND_WEAK, **BED, packing=packing, cache=False)


def test_a_bed_that_does_not_come_to_rest_says_so(bed, monkeypatch):
    monkeypatch.setattr(dem.prepare.stages, "_LONGEST", 0.1)
    work = Preparation(bed, grain=GRAIN)
    with pytest.raises(dem.BedFailure, match="did not come to rest"):
        work._settle(1e-30, {})


class Interrupted:
    """Ctrl-C at the n-th word of progress."""

    def __init__(self, at):
        self.left = at

    def stage(self, name, total):
        self.name = name

    def update(self, done):
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def test_a_preparation_that_was_stopped_goes_on_to_the_same_bits(made, monkeypatch, tmp_path):
    """Stopped in the rain and again while it settles; what was under way is gone from the cache afterwards."""
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path))
    stages = []
    for at in (6, 8, 9, 10):
        interrupted = Interrupted(at)
        with pytest.raises(KeyboardInterrupt):
            prepare_bed(SAND_WEAK, **BED, progress=interrupted)
        stages.append(interrupted.name)
        assert len(list((tmp_path / "unfinished").iterdir())) == 2
    assert {"rain", "settle"} <= set(stages)
    bed = prepare_bed(SAND_WEAK, **BED)
    assert same(bed.state(), made[1])
    assert not list((tmp_path / "unfinished").iterdir())


@pytest.mark.long
def test_a_preparation_is_kept_every_minute(made, monkeypatch, tmp_path):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path))
    monkeypatch.setattr(dem.prepare.laboratory, "_KEEP_INTERVAL", 0.0)
    kept = []
    keep = Laboratory.keep

    def keep_and_stop(work):
        keep(work)
        kept.append(work.done)
        if len(kept) == 4:
            stop()

    monkeypatch.setattr(Laboratory, "keep", keep_and_stop)
    with pytest.raises(Stop):  # as kill -9 would end it
        prepare_bed(SAND_WEAK, **BED)
    monkeypatch.setattr(Laboratory, "keep", lambda work: None)
    bed = prepare_bed(SAND_WEAK, **BED)
    assert same(bed.state(), made[1])


@pytest.mark.parametrize("damage", ["other steps", "no notes", "no bed"])
def test_what_was_kept_by_halves_is_not_gone_on_with(made, monkeypatch, tmp_path, damage):
    bed = dem.Bed.from_grains(SAND_WEAK, positions=[[0.012, 0.012, 0.01]], radii=[0.002], size=(0.024, 0.024, 0.03))
    plan = [Stage("rain", by="rough"), Stage("level")]
    work = Laboratory(bed, stages=plan, grain=GRAIN, progress=None, path=tmp_path / "a.npz")
    work.done, work.notes = 1, {"began": 0.0, "drag": 1.0, "first": 2.0}
    work.keep()
    again = Laboratory(bed, stages=plan, grain=GRAIN, progress=None, path=tmp_path / "a.npz")
    again.find()
    assert (again.done, again.notes) == (work.done, work.notes)
    notes = tmp_path / "a.json"
    if damage == "other steps":
        notes.write_text(notes.read_text().replace('"steps": 0', '"steps": 1'))
    elif damage == "no notes":
        notes.unlink()
    else:
        (tmp_path / "a.npz").write_bytes(b"half")
    again = Laboratory(bed, stages=plan, grain=GRAIN, progress=None, path=tmp_path / "a.npz")
    again.find()
    assert again.done == 0 and not again.notes


def test_levelling_keeps_the_contacts_of_what_stays(bed):
    """Right after the cut the forces away from it are what they were, springs of friction and rolling included."""
    before = bed.grains()
    cut = 0.024
    above = before.position[:, 2] > cut
    contacts = bed.contact_counts()
    less = bed.without(above)
    after = less.grains()
    assert less.grain_count == (~above).sum() and (after.id == np.arange(less.grain_count)).all()
    assert (after.radius == before.radius[~above]).all()
    assert (after.position == before.position[~above]).all()
    far = before.position[~above][:, 2] < cut - 1.2 * GRAIN
    assert far.sum() > 60
    assert (less.contact_counts()[far] == contacts[~above][far]).all()
    weight = bed.weight / bed.grain_count
    assert np.abs(after.force[far] - before.force[~above][far]).max() < 1e-9 * weight
    near = ~far
    assert np.abs(after.force[near] - before.force[~above][near]).max() > weight
    # Histories came over: without them friction would be gone and these grains would feel it.
    springs = less.state()["slide"]
    assert (np.linalg.norm(springs, axis=1) > 0).mean() > 0.9


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"size": (0.024, -0.024, 0.02)}, "size = .* must be three positive lengths"),
        ({"size": (0.024, 0.024)}, "size = .* must be three positive lengths"),
        ({"size": (0.024, 0.024, math.nan)}, "size = .* must be three positive lengths"),
        ({"grain": -0.004}, "grain = -0.004 must be a positive diameter"),
        ({"grain": 0.005}, "size: x = 0.024 m is less than 6 grains of 0.005 m; .*0.03 m"),
        ({"size": (0.024, 0.024, 0.015)}, "size: z = 0.015 m is less than 4 grains"),
        ({"spread": 0.6}, "spread = 0.6"),
        ({"grain": Normal(0.004, 0.1), "spread": 0.1}, "spread = 0.1 is for a mean diameter; Normal has a width"),
        ({"grain": "fine"}, "grain = 'fine' must be a mean diameter"),
        ({"floor": Facing(surface_energy=1.0)}, "surface_energy = 1.0 J/m2 needs a law"),
        ({"packing": 0.9}, "packing = 0.9 is no packing fraction"),
        ({"gravity": 0.0}, "gravity = 0.0 must be positive"),
        ({"max_overlap": 0.3}, "max_overlap = 0.3"),
        ({"young": -1.0}, "young = -1.0 must be positive"),
        ({"time_step": 1e-3}, "time_step = 0.001 s is outside 0 to"),
        ({"precision": "float16"}, "precision = 'float16' is unknown"),
        ({"arch": "tpu"}, "arch = 'tpu' is unknown"),
        ({"threads": 0}, "threads = 0 must be at least 1"),
    ],
)
def test_what_cannot_be_made_is_refused_by_name(options, words):
    with pytest.raises(ValueError, match=words):
        prepare_bed(SAND_WEAK, **BED | options)


def test_a_misspelt_option_raises():
    with pytest.raises(TypeError):
        Bed.prepare(SAND_WEAK, **BED, graine=0.004)


@pytest.mark.parametrize("grain", [0.006, 0.0019, 0.0007])
def test_a_width_of_six_grains_is_enough_whatever_rounding_does(grain):
    """6 * 0.006 is more than 0.036 to a computer; as decimals the two are one."""
    wide, deep = round(6 * grain, 6), round(4 * grain, 6)
    check_options((wide, wide, deep), grain, 9.81, 1, 0.05)
    check_stages(
        [parse_stage("rain"), parse_stage(f"level:{deep}"), parse_stage(f"cut:{wide}")],
        size=(2 * wide, wide, deep), grain=grain, sizes=Uniform(grain), cohesive=False,
    )  # fmt: skip
    with pytest.raises(ValueError, match="is less than 6 grains"):
        check_options((wide, 0.9999 * wide, deep), grain, 9.81, 1, 0.05)
