"""Modules, names and materials as earlier versions called them: they warn, and give what is called otherwise today.

Imports nothing of ours. The packages import this file, so that the old names work as soon as one of them is loaded.
"""

import sys
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from operator import attrgetter
from types import ModuleType
from typing import Any, TypeVar, cast

__all__ = [
    "BEFORE_RUN_2", "BEFORE_RUN_3", "MOVED", "RENAMED", "material_of_today", "renamed", "renamed_keywords",
    "renamed_names",
]  # fmt: skip

_MATERIALS = {"sand-calibrated": "sand"}
"""Materials and surfaces: a name that is still taken -> the name of today."""
BEFORE_RUN_2 = {"sand": "sand-weak"} | _MATERIALS
"""Names as runs and beds of before 2026-11-26 have them -> the names of today: `sand` was the weak one."""
BEFORE_RUN_3 = {"jsc1a": "jsc1a-heights"}
"""Surfaces as runs of the formats 1 and 2 have them -> the names of today: the grains of `jsc1a` were too cohesive."""

F = TypeVar("F", bound=Callable[..., Any])

_MODULES = {
    "coupling": {
        "coupling": (
            "bed_footing=bed_ground books=balance deprecated=planar_body followed=platform_run footing=ground "
            "spatial_friction=spatial_body"
        ),
    },
    "dem": {
        "dem.contact": "cohesion timestep",
        "dem.engine": (
            "energy holding=state ledger=dissipation lists rows runtime shape_table sleep sleep_kernels state stress"
        ),
        "dem.grains": "graded materials packing sizes",
        "dem.measure": "cutting element grading lid penetrometer repose shearing",
        "dem.prepare": "bedfile laboratory pouring=laboratory recipe stages",
        "dem.shapes": "mesh mesh_tree=mesh solids",
    },
    "dem.engine": {"dem.engine": "checkpoint=state"},
    "dem.grains": {"dem.grains": "curve=packing profile=packing"},
    "dem.prepare": {"dem.prepare": "pouring=laboratory"},
    "dem.shapes": {"dem.shapes": "mesh_tree=mesh"},
    "experiments": {
        "experiments": "plausible=check",
        "experiments.bed": (
            "bed_cone=cone bed_cut=cut bed_make=make bed_refine=refine bed_repose=repose bed_settings=settings "
            "bed_shear=shear bed_shear_settings=test_settings bed_test_settings=test_settings bed_tests=tests "
            "bed_work=work"
        ),
        "experiments.calibrate": (
            "calibrate_fit=fit calibrate_result=result calibrate_settings=settings calibrate_tests=tests"
        ),
        "experiments.check": "replicas",
        "experiments.cli": (
            "bed_commands benching cli_options=options cli_runs=runs doctor effects probes render_command=render"
        ),
        "experiments.compare": (
            "compare_common=experiment compare_settings=settings compare_spatial=spatial compare_tumbles=tumbles"
        ),
        "experiments.diagnose": "diagnose_settings=settings inspection",
        "experiments.grains": (
            "bed_box=sizes bed_graded=graded bed_progress bed_sizes=sizes bed_staged=staged following kept_material "
            "softening spells tracked_frames tumble_bed_settings=settings tumble_flight=flight where"
        ),
        "experiments.hop": (
            "hop_numbers=numbers hop_on_surface=on_surface hop_search=search hop_settings=settings hop_words=experiment"
        ),
        "experiments.paper": (
            "paper_claims=claims paper_settings=settings paper_transitions=transitions paper_variants=experiment"
        ),
        "experiments.penetrate": (
            "amended amended_runs=amended bed_given=given departures findings fit headline model_given=given "
            "penetrate_plan=units reference remarks=result run_campaign=recorded settings units"
        ),
        "experiments.platform": (
            "kept_platform=numbers lengths=settled platform_settings=settings settled surfaces tips=numbers "
            "tumble_platform=numbers"
        ),
        "experiments.runs": (
            "cli_streams=streams kept_results kernel_cache memory progress reading registry reporting=whole_runs "
            "runfolder=folder stopping strict whole_runs"
        ),
        "experiments.spatial": (
            "spatial_frames=result spatial_result=result spatial_settings=settings spatial_trial=trial"
        ),
        "experiments.suite": "suite_commands=commands suite_cost=cases",
        "experiments.tumble": (
            "campaign_settings footfalls sweep_ranges synthesis tumble_coupled=coupled tumble_grains=on_grains "
            "tumble_grains_frames=on_grains_result tumble_grains_result=on_grains_result tumble_opening=opening "
            "tumble_recorded=recorded tumble_settings=settings tumble_steppers=steppers tumble_sweep=sweep "
            "tumble_tables=synthesis tumble_trial=trial tumble_words=result"
        ),
        "experiments.validate": "validate_settings=settings",
    },
    "experiments.bed": {"experiments.bed": "words=settings"},
    "experiments.calibrate": {"experiments.calibrate": "words=settings"},
    "experiments.campaign": {"experiments.campaign": "templates=files"},
    "experiments.check": {
        "experiments.check": (
            "force_units=pushes lags=tumbles penetration=pushes tumble=tumbles turning=tumbles zeros=pushes"
        ),
    },
    "experiments.compare": {"experiments.compare": "common=experiment"},
    "experiments.diagnose": {
        "experiments.check": "lags=tumbles unit_factors=words",
        "experiments.diagnose.core": (
            "deciding diagnosis effect_equations=effect_texts effect_words=effect_texts equivalence=rivals next_steps "
            "outcome own_ways=deciding pairs prediction=rivals renoised scatter_gap search "
            "tumble_advice=effect_texts"
        ),
        "experiments.diagnose.fit": (
            "bounds evidence fitting gaps gate localise own=forms problem slopes=localise together tumble_fit=fitting "
            "tumble_shapes=forms tumble_steps=fitting"
        ),
        "experiments.diagnose.noise": (
            "astray=diverging colour jitter lone_beds noise_words=colour replicates spectrum stuck unrest=wander"
        ),
        "experiments.diagnose.push": (
            "penetration_data=data penetration_depth=depth penetration_drive=drive penetration_forms=forms "
            "penetration_law=law penetration_problem=problem penetration_remarks=remarks penetration_zeros=zeros"
        ),
        "experiments.diagnose.report": "candidates=sentences document sizes=document summary telling=sentences",
        "experiments.diagnose.tumble": (
            "tumble_checks=checks tumble_data=data tumble_follow=latent tumble_forms=forms "
            "tumble_forward=forward tumble_guess=guess tumble_latent=latent tumble_problem=problem "
            "tumble_readings=readings tumble_spikes=checks"
        ),
    },
    "experiments.diagnose.core": {
        "experiments.diagnose.core": (
            "effect_equations=effect_texts effect_words=effect_texts equivalence=rivals finishing=outcome "
            "own_ways=deciding prediction=rivals"
        ),
        "experiments.diagnose.report": "sizes=document",
    },
    "experiments.diagnose.fit": {"experiments.diagnose.fit": "own=forms slopes=localise"},
    "experiments.diagnose.noise": {"experiments.diagnose.noise": "astray=diverging unrest=wander"},
    "experiments.diagnose.report": {"experiments.diagnose.report": "candidates=sentences telling=sentences"},
    "experiments.diagnose.tumble": {
        "experiments.diagnose.fit": "fit=fitting steps=fitting",
        "experiments.diagnose.tumble": "spikes=checks",
    },
    "experiments.grains": {"experiments": "sentences=grains", "experiments.grains": "box=sizes"},
    "experiments.hop": {"experiments.hop": "words=experiment"},
    "experiments.paper": {"experiments.paper": "variants=experiment"},
    "experiments.penetrate": {
        "experiments.penetrate": "amended_runs=amended frames=experiment plan=units remarks=result",
    },
    "experiments.platform": {"experiments.platform": "kept_platform=numbers lengths=settled tips=numbers"},
    "experiments.plausible": {
        "experiments.check": (
            "findings force_units=pushes penetration=pushes tumble=tumbles turning=tumbles words zeros=pushes"
        ),
    },
    "experiments.runs": {"experiments.runs": "reporting=whole_runs"},
    "experiments.spatial": {"experiments.spatial": "frames=result on_law=on_grains"},
    "experiments.suite": {"experiments.suite": "cost=cases"},
    "experiments.tumble": {
        "experiments.tumble": "campaign_tables=synthesis on_grains_frames=on_grains_result words=result",
    },
    "experiments.validate": {
        "experiments.validate": "document=pages",
        "experiments.validate.base": "case cloud drops energy kept=drops parts=drops peers spheres",
        "experiments.validate.beds": "dosta friction_angle intrusion low_gravity silo slump",
        "experiments.validate.measured": "impact",
        "experiments.validate.contacts": (
            "books=balances cohesion collisions integrator large_body laws=other_codes microslip=law_alone "
            "oblique=impacts one_grain restitution=collisions sliding=other_codes spinning=impacts"
        ),
    },
    "experiments.validate.base": {"experiments.validate.base": "parts=drops"},
    "experiments.validate.beds": {"experiments.validate": "words=beds", "experiments.validate.measured": "impact"},
    "experiments.validate.contacts": {
        "experiments.validate": "words=contacts",
        "experiments.validate.contacts": (
            "books=balances laws=other_codes microslip=law_alone oblique=impacts restitution=collisions "
            "sliding=other_codes spinning=impacts"
        ),
    },
    "rigid": {
        "rigid.batch": "batch_kernel=kernel runtime",
        "rigid.ground": "grounds law_functions laws reaction rft",
        "rigid.model": "mechanics=model trial",
        "rigid.planar": (
            "dormand_prince=methods dynamics implicit=methods modes=events planar_events=events planar_located=located "
            "planar_paper=paper rest=statics statics trajectory"
        ),
        "rigid.platform": "actuation inertia platform_files=files rig solids spike",
        "rigid.spatial": "quaternions spatial_motion=motion spatial_steps=steps",
    },
    "rigid.batch.kernel": {"rigid.batch.kernel": "contacts=forces holds=forces samples=advance"},
    "rigid.batch_kernel": {
        "rigid.batch.kernel": "advance changes=events columns=parts dry=forces parts samples=advance stand",
    },
    "rigid.model": {"rigid.model": "mechanics=model"},
    "rigid.planar": {"rigid.planar": "dormand_prince=methods implicit=methods modes=events rest=statics"},
    "rigid.terms": {"rigid.terms": "mobilised=curves", "rigid.terms.body": "wires=wire_compliance"},
    "vis": {
        "vis.bed": "bed_cone=tests bed_cut=tests bed_repose=tests bed_shear=tests bed_tests=tests calibrate validation",
        "vis.compare": "compare_figures=report compare_spatial=report",
        "vis.diagnose": "campaign diagnose_figures=figures inspection=campaign",
        "vis.film": "jobs=film reel spatial_film=film spatial_pictures=film tumble_film=film",
        "vis.page": "columns=page folder numbers palette=plots state_figures=states style=plots tumble_series=states",
        "vis.paper": "hop paper_assumed=figures paper_measures=figures paper_paths=figures paper_run=figures",
        "vis.penetrate": (
            "amended=report plot_drag plot_drops plot_parts=plot_drag plots=report summary "
            "summary_tables=summary_parts summary_words=summary_parts"
        ),
        "vis.pictures": "arrows=canvas canvas frames meshes render scene sections stage=scene tracks",
        "vis.tumble": "tumble_beside=beside tumble_grains=grains tumble_pictures=report tumble_sweep=report",
    },
    "vis.compare": {"vis.compare": "figures=report"},
    "vis.diagnose": {"vis.diagnose": "inspection=campaign"},
    "vis.page": {"vis.page": "columns=page style=plots tumble_series=states"},
    "vis.paper": {"vis.paper": "run=figures"},
    "vis.penetrate": {"vis.penetrate": "amended=report plot_parts=plot_drag plots=report"},
    "vis.pictures": {"vis.pictures": "arrows=canvas stage=scene"},
    "vis.tumble": {"vis.tumble": "pictures=report sweep=report"},
}
"""Package of before -> package of today -> its modules, `old=new` where the name is another, too."""

_NAMES = {
    "coupling.balance": {"coupling.balance": "Books=EnergyBalance"},
    "coupling.bed_ground": {
        "coupling.bed_ground": "BedFooting=BedGround",
        "coupling.members": "FEWEST_SLOTS ball_member platform_members slots_of spatial_members",
    },
    "coupling.ground": {
        "coupling.ground": "FootReaction=Reaction Footing=Ground",
        "coupling.law_ground": "LawFooting=LawGround row_tips",
    },
    "coupling.master": {"coupling.master": "StepBooks=Exchange"},
    "coupling.planar_body": {
        "coupling.planar_body": "HAND_STEP=PLACEMENT_STEP HAND_TIME=PLACEMENT_TIME hand_time=placement_time",
        "hedgebed_renamed": "renamed_keywords",
    },
    "coupling.platform_run": {"coupling.platform_run": "Followed=PlatformRun"},
    "dem.contact": {
        "dem.contact.law": (
            "PAIR_WIDTH adhesive_range contact_force damping_factor effective_moduli pair_parameters turning_torque"
        ),
    },
    "dem.engine": {
        "dem.engine.engine": "Engine MOST_PRIMITIVES STEPS_PER_LAUNCH take_engine",
        "dem.engine.lists": "MOST_BODIES",
    },
    "dem.engine.state": {"dem.engine.state": "Held=Checkpoint"},
    "dem.engine.dissipation": {"dem.engine.dissipation": "Bookkeeping=BalanceKernels Ledger=Balance"},
    "dem.engine.lists": {"dem.grains.packing": "curve_ranks"},
    "dem.measure": {"dem.grains.packing": "bulk_packing packing_profile surface_height"},
    "dem.prepare": {
        "dem.prepare.prepare": "prepare_bed",
        "dem.prepare.code": "cache_folder fingerprint",
        "dem.prepare.specification": "BEARING Specification bound_of_mean check_options soft_enough",
    },
    "dem.prepare.laboratory": {
        "dem.prepare.prepare": "prepare_as",
        "dem.prepare.report": "Prepared",
    },
    "dem.shapes": {"dem.shapes.basic": "Ball Cone Cylinder Plane Primitive distance_to"},
    "dem.shapes.solids": {"dem.shapes.basic": "PLACE_WIDTH"},
    "experiments.cli": {
        "experiments.cli.main": "build_app",
        "experiments.cli.runs": "BAD_INPUT DONE FAILED STOPPED",
    },
    "experiments.diagnose.core.deciding": {"experiments.diagnose.core.deciding": "held_out_ways=held_out_divergences"},
    "experiments.diagnose.core.outcome": {"experiments.diagnose.core.outcome": "Told=Known"},
    "experiments.diagnose.core.renoised": {"experiments.diagnose.core.renoised": "unrest_of=wander_of"},
    "experiments.diagnose.fit.fitting": {"experiments.diagnose.tumble.data": "LOST ZERO_STD whiten"},
    "experiments.diagnose.fit.gaps": {"experiments.diagnose.report.gaps": "Gaps"},
    "experiments.diagnose.fit.localise": {"experiments.diagnose.fit.localise": "places_in=places"},
    "experiments.diagnose.noise.colour": {"experiments.diagnose.noise.colour": "find_loud=find_white_noise"},
    "experiments.diagnose.noise.diverging": {
        "experiments.diagnose.noise.diverging": (
            "allowed=most_diverging astray=diverging_trials astray_finding=divergence_finding "
            "astray_held_out=diverging_held_out"
        ),
    },
    "experiments.diagnose.noise.wander": {"experiments.diagnose.noise.wander": "Unrest=Wander find_unrest=find_wander"},
    "experiments.grains.on_bed": {"coupling.platform_run": "PlatformRun"},
    "experiments.paper": {"experiments.paper.experiment": "Job plan_jobs"},
    "experiments.penetrate": {"experiments.penetrate.beds": "choose_softness fingerprint"},
    "experiments.penetrate.recorded": {"experiments.campaign.files": "place_campaign"},
    "experiments.penetrate.settings": {"experiments.grains.sizes": "expected_grain_count"},
    "experiments.platform.numbers": {"experiments.tumble.trial": "Spikes spikes_of"},
    "experiments.suite": {"experiments.suite.cases": "Case EXPERIMENTS KEPT LONGEST estimate keep standing"},
    "experiments.tumble": {"experiments.tumble.result": "motion_columns quantities_of result_of trajectory_columns"},
    "experiments.tumble.campaign_settings": {"experiments.diagnose.settings": "CheckSettings"},
    "experiments.tumble.coupled": {"experiments.tumble.steppers": "law_feet=row_feet"},
    "experiments.tumble.on_grains_result": {"experiments.tumble.steppers": "sinkage_start"},
    "experiments.tumble.result": {
        "experiments.grains.bed_result": "residual_warning reversal_warning unsettled_warning",
    },
    "experiments.validate.base.case": {"experiments.validate.base.case": "told=tracked"},
    "experiments.validate.experiment": {"experiments.validate.pages": "markdown"},
    "experiments.validate.base.energy": {
        "experiments.validate.base.energy": "Book=EnergyRecord keep_book=record_energy",
    },
    "experiments.validate.base.peers": {"experiments.validate.contacts.other_codes": "Assembly CASES dense pairs"},
    "rigid.batch": {"rigid.batch.simulate": "BatchTrajectory simulate_batch"},
    "rigid.model": {"rigid.model.model": "Model State assemble make_parameters model_source parameter_names"},
    "rigid.planar": {"rigid.planar.simulate": "Method check_step longest_step step_bound"},
    "rigid.platform": {"rigid.platform.platform": "Platform Stance"},
    "rigid.spatial": {"rigid.spatial.spatial": "SpatialTrajectory SpatialTrial simulate standing"},
    "vis.bed": {"vis.bed.report": "write_bed_report"},
    "vis.bed.tests": {"vis.bed.tests": "said=quoted"},
    "vis.compare": {"vis.compare.report": "write_compare_report"},
    "vis.compare.report": {"vis.page.states": "draw_states"},
    "vis.diagnose": {"vis.diagnose.report": "write_diagnosis_report"},
    "vis.film.film": {
        "vis.pictures.render": "View",
        "vis.pictures.scene": "Scene",
    },
    "vis.page": {
        "vis.page.page": "Block Page Section Tile code figure listing table text",
        "vis.page.answer": "write_page",
    },
    "vis.paper": {"vis.paper.report": "write_paper_report"},
    "vis.page.plots": {"vis.penetrate.plot_drag": "Plot"},
    "vis.page.states": {"vis.page.folder": "read_columns"},
    "vis.paper.figures": {"vis.page.plots": "WIDTH new_figure"},
    "vis.penetrate.plot_drag": {"vis.page.plots": "WIDTH shades"},
    "vis.pictures": {"vis.pictures.pictures": "Picture Pictures make_pictures opengl_available render_apart"},
    "vis.pictures.scene": {"vis.pictures.sections": "FlatStage"},
    "vis.spatial": {"vis.spatial.report": "write_spatial_report"},
    "vis.tumble": {
        "vis.page.folder": "read_columns",
        "vis.page.states": "state_runs",
        "vis.page.plots": "STATES",
        "vis.tumble.report": "write_tumble_report",
    },
}
"""Module of today -> where its names of before are now -> these names, `old=new` where the name is another, too."""


def _listed(places: dict[str, str]) -> dict[str, tuple[str, str]]:
    """Old name -> place and name of today."""
    entries = [(place, entry.split("=")) for place, names in places.items() for entry in names.split()]
    return {names[0]: (place, names[-1]) for place, names in entries}


RENAMED = {
    f"{package}.{old}": ".".join(today)
    for package, places in _MODULES.items()
    for old, today in _listed(places).items()
}
"""Old name of a module: its name today."""

MOVED = {module: _listed(places) for module, places in _NAMES.items()}
"""Module of today -> name that it had, or that the module had which is now found there -> module and name of today."""


def material_of_today(name: str) -> str:
    """The name of today of a material or a surface, with a FutureWarning, which users see, where it is another."""
    today = _MATERIALS.get(name, name)
    if today != name:
        warnings.warn(f"{name!r} is called {today!r} since 2026-11-26", FutureWarning, stacklevel=3)
    return today


def renamed(old: str, new: str) -> Any:
    """A property `old` that gives the attribute `new`, dotted where it is a part's, with a DeprecationWarning."""

    def get(owner: object) -> Any:
        kind = type(owner).__name__
        warnings.warn(f"{kind}.{old} is now {new}: use {kind}.{new}", DeprecationWarning, stacklevel=2)
        return attrgetter(new)(owner)

    return property(get, doc=f"Old name of `{new}`.")


def renamed_keywords(**today: str) -> Callable[[F], F]:
    """A decorator: the method takes a keyword by its old name too, with a DeprecationWarning."""

    def decorate(method: F) -> F:
        @wraps(method)
        def call(owner: object, *args: Any, **options: Any) -> Any:
            for old in today.keys() & options.keys():
                warnings.warn(f"{old} of {type(owner).__name__} is now {today[old]}", DeprecationWarning, stacklevel=2)
                options[today[old]] = options.pop(old)
            return method(owner, *args, **options)

        return cast(F, call)

    return decorate


def renamed_names(module: str, **today: Any) -> Callable[[str], Any]:
    """The `__getattr__` of a package at the top: its old names, with a DeprecationWarning."""

    def find(name: str) -> Any:
        if name not in today:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        text = f"{module}.{name} is now {module}.{today[name].__name__}"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return today[name]

    return find


class _Renamed(MetaPathFinder, Loader):
    """Finds the old names."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: object = None) -> ModuleSpec | None:
        if name in RENAMED:
            return ModuleSpec(name, self)
        spec = PathFinder.find_spec(name, path) if name in MOVED else None
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _WithOldNames(name, spec.loader.path)
        return spec

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        today = RENAMED[spec.name]
        warnings.warn(f"{spec.name} is deprecated: use {today}", DeprecationWarning, stacklevel=2)
        module = import_module(today)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # the import has put the old name there


class _WithOldNames(SourceFileLoader):
    """Loads a module of today, which then knows the names that have moved away from it."""

    def exec_module(self, module: ModuleType) -> None:
        super().exec_module(module)
        moved, own = MOVED[module.__name__], vars(module).get("__getattr__")

        def find(name: str) -> Any:
            if name not in moved and own is not None:
                return own(name)
            if name not in moved:
                raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")
            place, today = moved[name]
            text = f"{module.__name__}.{name} is deprecated: use {place}.{today}"
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return getattr(import_module(place), today)

        vars(module)["__getattr__"] = find


sys.meta_path.insert(0, _Renamed())  # before the files, as an old package's modules would be found there a second time
