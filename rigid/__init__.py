"""The platform and the surface laws of the paper's model; knows nothing of grains."""

from .grounds import SpringDamper, SurfaceGround
from .laws import GROUNDS
from .reaction import Contact, Reaction
from .spike import Section, Spike

__all__ = ["GROUNDS", "Contact", "Reaction", "Section", "SpringDamper", "Spike", "SurfaceGround"]
