"""Settings of `hedgebed mujoco`: a robot of one's own, its feet, and what they stand on."""

from typing import Any, Self

from pydantic import Field, model_validator

from experiments.grains.lammps import ON_GRAINS, RANKS, lammps_fault
from experiments.grains.settings import HIDDEN, GrainsSettings
from experiments.platform.settings import Assignments, NotNegative, Positive
from experiments.runs.strict import SeedNumber
from rigid.checks import nearest
from rigid.ground.laws import GROUNDS
from rigid.ground_file import is_ground_file
from vis.page.sentences import Sentences

__all__ = ["RobotSettings"]

say = Sentences(__package__)

ON_ANY_GROUND = ("substeps", "extrapolation", "iterations", "frame_count", "checkpoint_interval")
"""Of `GrainsSettings`, those that a surface law takes too."""
DEFAULT, OF_DEFAULT = "rft", (None, "sand")
"""The ground of a robot that is given none, and the surfaces of which it is the default; None: the default surface."""
OF_THE_SPRING = ("stiffness", "damping", "scale_with_gravity")
"""Settings that belong to the spring-damper, which is the ground where one of them is given and no other is."""
SPRING = (*ON_GRAINS, "spring-damper")
"""Grounds that take K and C: on grains the forecast does."""
NOT_OURS = ("lowering_speed", "body_steps")
"""Of `GrainsSettings`, those that a robot has no use for."""


class RobotSettings(GrainsSettings):
    """A robot of MuJoCo, its feet on a surface law or on a bed of grains."""

    model: str = Field(min_length=1, description="The robot: an MJCF or URDF file, or an example that ships.")
    feet: tuple[str, ...] = Field(min_length=1)
    """Names of geoms of the model that stand on the ground, or of sites (points, on a surface law only); spike_* means
    all whose name begins so."""
    keyframe: str | None = None
    """Keyframe of the model where the robot starts, with its controls; the model's own start if not given."""
    height: NotNegative | None = None
    """Height of the lowest foot over the surface at the start [m]; as the model has it if not given."""
    controller: str | None = None
    """Python file and function that control the robot, as my_robot.py:control, or of an example that ships, as
    hopper:control. It is called as control(model, data) at every time step of the model and sets data.ctrl. The
    controls of the start if not given."""
    gravity: NotNegative | None = Field(None, description="Gravity, downwards [m/s2]; the model's if not given.")
    duration: Positive = Field(2.0, le=3600, description="Simulated time [s].")

    surface: str | None = None
    """Material: steel, brick, sand, sand-weak, jsc1a or jsc1a-heights; if not given, that of the grains in a
    ground.toml, else sand."""
    ground: str = DEFAULT
    """What computes the surface's force: a surface law (spring-damper, hunt-crossley, power, power-irreversible,
    katsuragi-durian, bekker, rft), the file of one (ground.toml, as hedgebed calibrate writes it), bed (of grains) or
    lammps (a bed whose grains are in LAMMPS). If not given: rft on sand; spring-damper on other surfaces, and with
    stiffness, damping or scale_with_gravity."""
    ground_parameters: Assignments = ()
    """Parameters of a law other than the spring-damper, for one foot, as name=value in SI units (exponent=1.5).
    Defaults are those of a ball tip of 12 mm, scaled to the size of each foot."""
    ignore_foot_size: bool = False
    """Run a law whose default numbers belong to another ground; without it this is refused. The numbers are those of a
    tip of 12 mm on brick (hunt-crossley, power), here used on grains, or of one in sand (power-irreversible,
    katsuragi-durian, bekker, rft), here used on hard ground. They are not scaled to the foot."""
    ignore_gravity_range: bool = False
    """Run a ground.toml under a gravity outside its range; without it this is refused."""
    stiffness: Positive | None = None
    """K of one foot [N/m]. If not given, on hard surfaces that of a spike of the platform; on grains that of a ball tip
    of 12 mm times the area of the foot over the tip's."""
    damping: NotNegative | None = None
    """C of one foot that moves into the ground [N s/m]; if not given, found as K is, with that ratio of areas to the
    power 1.25."""
    scale_with_gravity: bool | None = None
    """Whether K and C of the surface, which are those of 1 g, follow gravity: K in proportion, C with its square root,
    as in grains without cohesion. If not given: on sand, where the map of hedgebed ground covers gravity (1e-6 g to
    1 g) and feet (1 to 100 mm). On jsc1a, K and C of each foot are those of its map unless this is off."""
    mu_s: NotNegative | None = Field(None, description="Static friction [1]; the surface's if not given (sand: 0.6).")
    mu_d: NotNegative | None = None
    """Sliding friction [1]; the surface's if not given (sand: 0.3), half of mu_s where that is."""

    spike_friction: NotNegative = Field(0.5, description="On a bed: friction coefficient of feet and grains [1].")
    spike_restitution: float = Field(
        0.5, ge=0.01, le=1, description="On a bed: coefficient of restitution of feet and grains [1]."
    )
    lowering_speed: Positive | None = Field(
        None, description="None: a robot is not set down.", json_schema_extra=HIDDEN
    )
    body_steps: int = Field(1, ge=1, description="1: the model sets the steps [1].", json_schema_extra=HIDDEN)
    substeps: int = Field(10, ge=1, le=200)
    """Time steps of the ground between two exchanges of forces with the robot [1]."""
    extrapolation: int = Field(0, ge=0, le=2, description="Order of the extrapolation of the exchanged forces [1].")
    iterations: int = Field(1, ge=1, le=50)
    """Most iterations of an exchange [1]; 1: explicit exchange. Not with ground lammps."""
    frame_count: int = Field(
        30, ge=0, le=1000, description="Number of frames for pictures, film and ParaView; 0: none."
    )
    checkpoint_interval: Positive = Field(60.0, description="Time between two checkpoints, in real time [s].")
    bed_size: tuple[Positive, Positive, Positive] = (0.3, 0.3, 0.08)
    """On a bed: its size along x and y (both periodic) and its depth [m]; the feet start over its middle."""
    grain: Positive = Field(0.006, description="On a bed: mean grain diameter [m].")
    settle_gravity: Positive | None = None
    """On a bed: gravity in which it is prepared, lowered to that of the run before the robot starts, to save time
    [m/s2]; that of the run if not given."""
    ranks: int | None = Field(None, ge=1, le=4096, description=RANKS)
    seeds: tuple[SeedNumber, ...] = ()
    """On a bed: seeds; each prepares one bed, and the result is the mean over the beds with its 95 % interval. One bed,
    that of seed, if not given."""

    @property
    def on_grains(self) -> bool:
        """Whether the ground is made of grains."""
        return self.ground in ON_GRAINS

    def of_bed(self, seed: int) -> Self:
        """The same on the one bed of this seed."""
        return self.model_copy(update={"seed": seed, "seeds": ()})

    @property
    def default_law(self) -> str:
        """The surface law of this robot where no ground is given."""
        of_spring = any(getattr(self, name) is not None for name in OF_THE_SPRING)
        return "spring-damper" if of_spring or self.surface not in OF_DEFAULT else DEFAULT

    @model_validator(mode="before")
    @classmethod
    def _choose_ground(cls, given: Any) -> Any:
        """The spring-damper where no ground is given, and the surface or another setting is not one of `rft` on sand.

        Under flat feet 3D-RFT is nearer to grains of sand than the spring-damper, and it does not spring back
        (docs/notes/mujoco.md). Its numbers are those of dry sand, so that other surfaces have the spring-damper.
        """
        if not isinstance(given, dict) or given.get("ground") is not None:
            return given
        of_spring = any(given.get(name) is not None for name in OF_THE_SPRING)
        other = given.get("surface") not in OF_DEFAULT
        return given | {"ground": "spring-damper"} if of_spring or other else given

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (self._of_ground(), self._scaled(), self._friction(), self._of_grains()):
            if finding:
                raise ValueError(finding)
        return self

    def _of_ground(self) -> str | None:
        if is_ground_file(self.ground):
            own = self.ground_parameters or self.stiffness is not None or self.damping is not None
            if self.ignore_foot_size:
                return say("nothing_unsized", s=self)
            return say("of_a_file", s=self) if own else None
        if self.ignore_gravity_range:
            return say("no_range", s=self)
        known = [*GROUNDS, *ON_GRAINS]
        if self.ground not in known:
            return say("no_ground", s=self, known=nearest(self.ground, known))
        if self.ground_parameters and self.ground in SPRING:
            return say("no_parameters", s=self, given=" ".join(self.ground_parameters))
        of_spring = self.stiffness is not None or self.damping is not None
        if of_spring and self.ground not in SPRING:
            return say("of_the_spring", s=self)
        sized = self.ground in SPRING or (self.ground == DEFAULT and self.surface in OF_DEFAULT)
        return say("nothing_unsized", s=self) if self.ignore_foot_size and sized else None

    def _scaled(self) -> str | None:
        if not self.scale_with_gravity:
            return None
        if self.ground not in SPRING:
            return say("scaled_law", s=self)
        return say("scaled_given") if self.stiffness is not None and self.damping is not None else None

    def _friction(self) -> str | None:
        above = self.mu_s is not None and self.mu_d is not None and self.mu_d > self.mu_s
        return say("mu_d_above_mu_s", s=self) if above else None

    def _of_grains(self) -> str | None:
        fields = type(self).model_fields
        for name in NOT_OURS:
            if getattr(self, name) != fields[name].default:
                return say(f"no_{name}", value=getattr(self, name))
        if self.settle_gravity is not None and not self.on_grains:
            return say("of_a_bed", name="settle_gravity", value=self.settle_gravity)
        if self.seeds and not self.on_grains:
            return say("of_a_bed", name="seeds", value=" ".join(map(str, self.seeds)))
        if self.seeds and self.seed != fields["seed"].default:
            return say("seed_and_seeds", s=self)
        if len(set(self.seeds)) < len(self.seeds):
            return say("seed_twice", seeds=" ".join(map(str, self.seeds)))
        if self.on_grains or self.ranks is not None:
            return self.sleep_fault() or lammps_fault(self)
        for name in GrainsSettings.model_fields:
            if name not in (*ON_ANY_GROUND, "threads") and getattr(self, name) != fields[name].default:
                return say("of_a_bed", name=name, value=getattr(self, name))
        return None
