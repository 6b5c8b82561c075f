"""Assemblies that slide with a dashpot, where LIGGGHTS, LAMMPS and the bed have three laws (``laws``).

Each code is held against its own law, written once in numpy with one switch for the three. A peer that its own law
meets to rounding, and a bed that its own meets as well as where nothing slides, differ in that switch and in nothing
else; how much it does stands in the remarks, and is no error of either.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.validate.base import peers
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, told

from .laws import written_again

__all__ = ["CASES"]

WHAT = (
    ("force", slice(9, 12), "force on a grain over the largest"),
    ("velocity", slice(3, 6), "velocity over the largest"),
    ("place", slice(0, 3), "place over a diameter"),
)
# What the bed's better order in time makes where nothing slides (case liggghts-contacts), and rounding over some
# hundred steps; LAMMPS leaves out turns of the spring below 1e-10 of the bound.
_AS_UNSLID, _ROUNDING = 0.03, 1e-8
_FINER = 8


def _differences(here: np.ndarray, there: np.ndarray, assembly: peers.Assembly) -> dict[str, np.ndarray]:
    """Largest at each sample, shape [samples], for each of ``WHAT``."""
    off = here - there
    off[..., :2] -= np.array(assembly.period) * np.round(off[..., :2] / np.array(assembly.period))
    scale = {name: np.abs(there[..., part]).max() for name, part, _ in WHAT} | {"place": 2 * assembly.radii.mean()}
    return {name: np.abs(off[..., part]).max(axis=(1, 2)) / scale[name] for name, part, _ in WHAT}


def _law(law: str, assembly: peers.Assembly, restitution: float, friction: float) -> np.ndarray:
    return written_again(
        law, assembly, young=peers.YOUNG, poisson=peers.POISSON, density=peers.DENSITY,
        restitution=restitution, friction=friction,
    )  # fmt: skip


def _compute(peer: str, make: Callable[[], peers.Assembly], labels: tuple[str, ...], tell: Tell) -> Outcome:
    about = peers.PEERS[peer]
    if about.find() is None:
        return about.lacking()
    assembly = make()
    rows: list[Comparison] = []
    curves: list[Curve] = []
    remarks: list[str] = []
    time = 1e6 * assembly.step * assembly.every * np.arange(assembly.samples)
    for label in told(labels, tell):
        law = peers.LAWS[label]
        bed, other = peers.ours(assembly, *law), peers.theirs(peer, assembly, *law)
        found = {
            "bed": _differences(bed, _law("bed", assembly, *law), assembly),
            about.name: _differences(other, _law(peer, assembly, *law), assembly),
        }
        for who, band in (("bed", _AS_UNSLID), (about.name, _ROUNDING)):
            most = {name: float(values.max()) for name, values in found[who].items()}
            rows += [near_zero(f"{label}, {who} beside its law: {what}", most[name], band) for name, _, what in WHAT]
            curves.append(Curve(f"{label}: {who}, its law", time, np.maximum(found[who]["force"], 1e-17)))
        if label == _SLIDING:
            rows.append(_order(label, assembly, float(found["bed"]["velocity"].max())))
        apart = _differences(bed, other, assembly)
        curves.append(Curve(f"{label}: bed, {about.name}", time, np.maximum(apart["force"], 1e-17), False))
        most_apart = ", ".join(f"{apart[name].max():.2g} ({what})" for name, _, what in WHAT)
        remarks.append(f"{label}: with a law each, bed and {about.name} differ by up to {most_apart}.")
    return Outcome(rows, [Plot(*peers.LARGEST_FORCE, curves, "y")], remarks)


def _order(label: str, assembly: peers.Assembly, coarse: float) -> Comparison:
    """At what power of the step the bed's velocities come to those of its law."""
    fine = peers.refined(assembly, _FINER)
    there = _law("bed", fine, *peers.LAWS[label])
    finer = float(_differences(peers.ours(fine, *peers.LAWS[label]), there, fine)["velocity"].max())
    order = math.log(coarse / finer) / math.log(_FINER)
    about = f"{label}, bed beside its law: order at which velocities come together"
    return Comparison(about, "1", 1.0, order, 0.1, False)


_STICKING, _SLIDING = "e = 0.5, friction 50", "e = 0.5, friction 0.5"
CASES = {
    f"{peer}-{name}-sliding": partial(_compute, peer, make, labels)
    for peer, labels in (("liggghts", (_SLIDING,)), ("lammps", (_STICKING, _SLIDING)))
    for name, make in (("contacts", peers.pairs), ("cloud", peers.dense))
}
