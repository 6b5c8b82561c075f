"""The platform and the surface laws of the paper's model; knows nothing of grains."""

from .batch import BatchTrajectory, simulate_batch
from .grounds import SpringDamper, SurfaceGround
from .laws import GROUNDS
from .planar import simulate
from .reaction import Contact, Reaction
from .spike import Section, Spike
from .terms import EFFECTS, Term
from .trajectory import STATES, Trajectory
from .trial import Effect, Ground, Trial

__all__ = [
    "EFFECTS",
    "GROUNDS",
    "STATES",
    "BatchTrajectory",
    "Contact",
    "Effect",
    "Ground",
    "Reaction",
    "Section",
    "SpringDamper",
    "Spike",
    "SurfaceGround",
    "Term",
    "Trajectory",
    "Trial",
    "simulate",
    "simulate_batch",
]
