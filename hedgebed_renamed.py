"""Modules under the names that they had in earlier versions: an import from there warns and gives the module of today.

Imports nothing of ours. The packages import this file, so that the old names work as soon as one of them is loaded.
"""

import sys
import warnings
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

__all__ = ["RENAMED"]

RENAMED = {
    "coupling.footing": "coupling.ground",
    "dem.cutting": "dem.measure.cutting",
    "dem.element": "dem.measure.element",
    "dem.energy": "dem.engine.energy",
    "dem.laboratory": "dem.prepare.laboratory",
    "dem.materials": "dem.grains.materials",
    "dem.penetrometer": "dem.measure.penetrometer",
    "dem.repose": "dem.measure.repose",
    "dem.sizes": "dem.grains.sizes",
    "dem.stress": "dem.engine.stress",
    "dem.timestep": "dem.contact.timestep",
    "experiments.amended": "experiments.penetrate.amended",
    "experiments.bed_graded": "experiments.grains.graded",
    "experiments.progress": "experiments.runs.progress",
    "experiments.settings": "experiments.penetrate.settings",
    "experiments.softening": "experiments.grains.softening",
    "experiments.tumble_flight": "experiments.grains.flight",
    "rigid.actuation": "rigid.platform.actuation",
    "rigid.inertia": "rigid.platform.inertia",
    "rigid.laws": "rigid.ground.laws",
    "rigid.reaction": "rigid.ground.reaction",
    "vis.columns": "vis.page.columns",
    "vis.frames": "vis.pictures.frames",
    "vis.meshes": "vis.pictures.meshes",
}
"""Old name of a module that the documentation named: its name today."""


class _Renamed(MetaPathFinder, Loader):
    """Finds the old names."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        return ModuleSpec(name, self) if name in RENAMED else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        today = RENAMED[spec.name]
        warnings.warn(f"{spec.name} is deprecated: use {today}", DeprecationWarning, stacklevel=2)
        module = import_module(today)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # the import has put the old name there


sys.meta_path.append(_Renamed())
