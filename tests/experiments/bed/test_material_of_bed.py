"""A bed sets its material for every command: one beside it must be the same; and its grains can be made stiffer."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from dem import Bed
from dem.grains.materials import SAND
from experiments.bed.test_settings import BedReposeSettings
from experiments.bed.tests import check_bed
from experiments.grains.softening import Softening
from experiments.penetrate.experiment import _Work
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress

MINE = replace(SAND, name="mine", rolling_friction=0.5, sources={})
SMALL = {"tip_diameter": 0.006, "allow_coarse": True, "shaft_length": 0.04, "depth": 0.0045, "load": 0.05}


def write_material(path, stuff):
    numbers = [f"{one.name} = {getattr(stuff, one.name)!r}" for one in fields(stuff)
               if one.name not in ("name", "cohesion", "surface_energy", "grain", "sources", "tangential")]  # fmt: skip
    path.write_text("\n".join(['format = "hedgebed-material/1"', f'name = "{stuff.name}"', *numbers]) + "\n")
    return str(path)


@pytest.fixture
def bed(tmp_path):
    """The file of a bed of a material that does not ship, in a folder without the material's file."""
    side = np.arange(0.002, 0.04, 0.0041)
    places = np.array([[x, y, z] for x in side for y in side for z in side])
    made = Bed.from_grains(
        MINE, positions=places, radii=np.full(len(places), 0.002), size=(0.041, 0.041, 0.04), young=1e7, threads=1
    )
    (tmp_path / "made").mkdir()
    made.save(tmp_path / "made" / "bed.npz")
    return tmp_path / "made" / "bed.npz"


def test_a_bed_sets_its_material_and_another_beside_it_is_refused_by_every_command(bed):
    """By the copy in the folder of the run that made it, or by a file with the same numbers."""
    with pytest.raises(ValueError, match="give --material with the file"):
        PenetrateSettings(bed=str(bed), **SMALL)
    own = write_material(bed.parent / "material.toml", MINE)
    other = write_material(bed.parent / "other.toml", replace(MINE, rolling_friction=0.2))
    for given in ({}, {"material": own}):
        assert PenetrateSettings(bed=str(bed), **SMALL, **given).material == own
        check_bed(BedReposeSettings(bed=str(bed), **given))
    with pytest.raises(ValueError, match="leave material out, or use the file"):
        PenetrateSettings(bed=str(bed), **SMALL, material=other)
    with pytest.raises(ValueError, match="leave material out, or use the file"):
        check_bed(BedReposeSettings(bed=str(bed), material=other))


@pytest.mark.parametrize(("name", "stiffer"), [("made", True), (None, False)])
def test_a_bed_that_is_given_is_made_stiffer_and_a_modulus_that_is_set_is_kept(name, stiffer, tmp_path):
    """`settings.young` is the bed's own where a bed is given, and the user's where none is."""
    settings = SimpleNamespace(bed=name, young=1e7, time_step=1e-5, max_overlap=0.05)
    chosen = Softening(**{one.name: 1.0 for one in fields(Softening)} | {"young": 1e7, "real": 7e10})
    folder = RunFolder.create(tmp_path / "run", "penetrate", PenetrateSettings())
    work = _Work(settings, [], chosen, folder, Progress(), None)
    error = RuntimeError("an overlap of 5.02 % of a diameter went past its bound of 5 %")
    assert work._made_stiffer(error, 1) == stiffer
    assert work._young(1) > 1e7 if stiffer else work._young(1) == 1e7


def test_the_foot_that_is_too_short_is_refused_for_a_run_that_is_made():
    short = {"shaft_length": 0.02, "seeds": (1,)}
    with pytest.raises(ValueError, match="as a drop may reach"):
        PenetrateSettings(**short)
    with pytest.raises(ValueError, match="as the set-down of the load may reach"):
        PenetrateSettings(**short, drop_speeds=())
