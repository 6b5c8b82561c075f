"""Modules, names and keywords that are called otherwise today are still found as they were, with a warning."""

import importlib
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import pytest

import coupling
from hedgebed_renamed import MOVED, RENAMED
from rigid import Trial

ROOT = Path(__file__).resolve().parents[2]
NAMES_OF_BEFORE = {  # as they were public in earlier versions; this list stays as it is
    "coupling": "BedGround CoupledTumble LawGround Master Penetration SpatialRun TumblesInARow drive drop set_down",
    "coupling.bed_footing": "BedFooting platform_members",
    "coupling.deprecated": "PlacedBody renamed_keywords",
    "coupling.footing": "FootReaction Footing LawFooting",
    "dem": "Ball Bed BedFailure Box Grains Material Mesh Prepared Sieve Sleep material measure_grading",
    "dem.bed": "Bed BedFailure",
    "dem.engine.checkpoint": "Checkpoint",
    "dem.grains.curve": "curve_ranks",
    "dem.grains.profile": "bulk_packing packing_profile surface_height",
    "dem.laboratory": "Prepared prepare_as",
    "dem.shapes": "Ball Cone Cylinder Plane",
    "dem.shapes.mesh_tree": "MeshTree mesh_tree",
    "experiments.bed.settings": "BedSettings",
    "experiments.campaign": "Campaign Recording Settings read_campaign run write_campaign",
    "experiments.campaign.templates": "TEMPLATES new_campaign",
    "experiments.diagnose.core.equivalence": "CLOSE Rival compare",
    "experiments.diagnose.noise.astray": "astray astray_held_out",
    "experiments.diagnose.noise.unrest": "Unrest find_unrest",
    "experiments.diagnose": "Settings check resume run",
    "experiments.grains.box": "carried_height expected_grain_count",
    "experiments.grains.on_bed": "PlatformOnBed PlatformRun",
    "experiments.hop.settings": "HopSettings",
    "experiments.paper.variants": "Variant variants",
    "experiments.penetrate.plan": "PenetratePlan",
    "experiments.penetrate": "Settings check resume run",
    "experiments.runs.reporting": "PictureCosts write_report",
    "experiments.spatial.frames": "SpatialFrames",
    "experiments.tumble": "Settings check resume run",
    "experiments.tumble.words": "MOST stayed_words tumble_sentences way_through",
    "experiments.validate.document": "markdown",
    "rigid": "Platform Reaction SpatialTrial Trial Tumbler read_platform simulate simulate_batch simulate_spatial",
    "rigid.model.mechanics": "contact_arms divide_mass",
    "rigid.planar.implicit": "Implicit",
    "vis": "FrameWriter read_frames write_report",
    "vis.page.style": "BED INK MODEL styled",
    "vis.paper.run": "VARIANTS PaperRun in_order",
    "vis.penetrate.plot_parts": "Plot above_surface by_speed has_model spread_words",
    "vis.pictures": "Picture Pictures make_pictures",
    "vis.pictures.stage": "Eye FlatStage Stage",
}


@pytest.mark.parametrize("old", RENAMED)
def test_an_old_name_warns_and_is_the_module_of_today(old):
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"{old} is deprecated: use {RENAMED[old]}"):
        module = importlib.import_module(old)
    assert module is importlib.import_module(RENAMED[old])
    assert module.__name__ == module.__spec__.name == RENAMED[old]


@pytest.mark.parametrize(("module", "old"), [(module, old) for module, names in MOVED.items() for old in names])
def test_a_name_that_has_left_its_module_warns_and_is_what_it_is_today(module, old):
    place, today = MOVED[module][old]
    with pytest.warns(DeprecationWarning, match=f"{module}.{old} is deprecated: use {place}.{today}"):
        found = getattr(importlib.import_module(module), old)
    assert found is getattr(importlib.import_module(place), today)


@pytest.mark.parametrize("old", NAMES_OF_BEFORE)
def test_a_public_name_of_before_is_found_and_warns_where_it_has_moved(old):
    if old in RENAMED:
        sys.modules.pop(old, None)
    with warnings.catch_warnings(record=True) as imported:
        warnings.simplefilter("always")
        module = importlib.import_module(old)
    assert any(f"{old} is deprecated" in str(warned.message) for warned in imported) == (old in RENAMED)
    today = module.__name__
    for name in NAMES_OF_BEFORE[old].split():
        with warnings.catch_warnings(record=True) as asked:
            warnings.simplefilter("always")
            found = getattr(module, name)
        moved = MOVED.get(today, {}).get(name)
        if moved is not None:
            assert f"{today}.{name} is deprecated: use {'.'.join(moved)}" in str(asked[0].message)
            assert found is getattr(importlib.import_module(moved[0]), moved[1])
        else:
            assert not asked, name


def test_no_old_name_hides_a_file_or_a_name_of_today():
    for old in RENAMED:
        path = ROOT.joinpath(*old.split("."))
        assert not path.with_suffix(".py").exists() and not (path / "__init__.py").exists(), old
    for module, names in MOVED.items():
        today = importlib.import_module(module)
        assert not names.keys() & vars(today).keys(), module
        assert not any(ROOT.joinpath(*module.split("."), f"{name}.py").exists() for name in names), module


def test_a_module_with_old_names_still_refuses_what_it_never_had():
    module = importlib.import_module("dem.prepare")
    with pytest.raises(AttributeError, match=r"module 'dem\.prepare' has no attribute 'cake'"):
        module.cake


def test_a_package_that_finds_names_itself_goes_on_with_it():
    package = importlib.import_module("experiments.campaign")
    assert package.Settings.__module__ == "experiments.tumble.campaign_settings"
    with pytest.raises(AttributeError, match=r"module 'experiments\.campaign' has no attribute 'cake'"):
        package.cake


@pytest.mark.parametrize("folder", ["dem", "rigid", "coupling", "experiments", "vis"])
def test_old_names_work_in_a_fresh_process_and_the_warning_names_the_line_that_imports(folder):
    old = next(name for name in RENAMED if name.startswith(f"{folder}."))
    code = f"import warnings\nwarnings.simplefilter('error', DeprecationWarning)\nimport {old}"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert f"DeprecationWarning: {old} is deprecated" in done.stderr


def test_imports_of_the_first_version_work_in_a_fresh_process_and_name_their_lines():
    lines = [
        "from coupling.footing import Footing, LawFooting, row_tips",
        "from coupling.bed_footing import BedFooting, platform_members",
        "from dem.laboratory import Prepared, prepare_as",
        "from dem.ledger import Ledger",
        "from dem.prepare import Specification, prepare_bed",
        "from dem.shapes import Ball",
        "from rigid.platform import Platform",
        "from rigid.spatial import SpatialTrial",
        "from rigid.trial import Trial",
        "from experiments.runfolder import RunFolder",
        "from experiments.validate.parts import part",
    ]
    done = subprocess.run(
        [sys.executable, "-W", "always", "-c", "\n".join(lines)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for number, _ in enumerate(lines, 1):
        assert f"<string>:{number}: DeprecationWarning" in done.stderr


def test_runs_take_their_ground_by_the_keyword_of_before():
    trial = Trial(gravity_sim=0.0834, counterweight=5.21, torque=0.22, mu_s=0.6, stiffness=82.2, damping=0.713)
    law = coupling.LawGround.of_trial(trial)
    with pytest.warns(DeprecationWarning, match="footing of CoupledTumble is now ground") as warned:
        run = coupling.CoupledTumble(trial, footing=law, duration=0.01)
    assert run.ground is law
    assert warned[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="footing of TumblesInARow is now ground"):
        assert coupling.TumblesInARow(trial, footing=law, tumbles=2, duration=0.01).ground is law
    with pytest.warns(DeprecationWarning, match="footing of Master is now ground"):
        assert coupling.Master(run.body, footing=law).ground is law
    with pytest.raises(TypeError, match="multiple values"), pytest.warns(DeprecationWarning):
        coupling.Master(run.body, law, footing=law)


def test_a_ground_is_held_and_taken_back_as_before():
    trial = Trial(gravity_sim=0.0834, counterweight=5.21, torque=0.22, mu_s=0.6, stiffness=82.2, damping=0.713)
    law = coupling.LawGround.of_trial(trial)
    with pytest.warns(DeprecationWarning, match="LawGround.hold is now checkpoint"):
        held = law.hold()
    with pytest.warns(DeprecationWarning, match="LawGround.take_back is now rollback"):
        law.take_back(held)
    assert isinstance(coupling.BedGround.hold, property)


@pytest.mark.parametrize(("old", "today"), [("set_gravity", "set_gravity"), ("keep_book", "track_contact_work")])
def test_a_ground_calls_its_bed_by_the_names_of_before(old, today):
    ground = coupling.BedGround.__new__(coupling.BedGround)
    ground.bed = SimpleNamespace(**{today: lambda *given: (today, *given)})
    with pytest.warns(DeprecationWarning, match=f"BedGround.{old} is now bed.{today}"):
        assert getattr(ground, old)(1.6) == (today, 1.6)


@pytest.mark.parametrize("old", ["members", "spike"])
def test_a_bed_takes_its_body_by_the_keywords_of_before(old):
    with (
        pytest.warns(DeprecationWarning, match=f"{old} of BedGround is now body"),
        pytest.raises(AttributeError, match="no attribute 'surface'"),  # as far as it comes without a bed
    ):
        coupling.BedGround(object(), **{old: []})
