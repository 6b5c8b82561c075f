"""Three-dimensional resistive force theory (3D-RFT): what grains push back with on a body that moves through them.

Agarwal, Goldman and Kamrin, PNAS 120 (2023), e2214017120 (arXiv 2205.14920). A piece of surface at depth d with outward
normal n, moving along v with n.v >= 0, bears the traction xi_n d alpha(n, v): alpha is a polynomial of third degree in
x1 = -z.v, x2 = -z.n, x3 = n.v (z up). The friction of surface and grains bounds its part along the surface. The one
number of the grains is xi_n = rho_c g (894 mu^3 - 386 mu^2 + 89 mu) [N/m3]. The inertia of the grains adds lambda rho
(n.v)^2 along -n (Agarwal et al., Science Advances 7 (2021), eabe0631).

The 60 coefficients below are the paper's Table S1 as two public transcriptions have it. They differ in one, that of
x3 x2^2 in f2: 0.18589 in github.com/KKKobefeng/3D-RFT, 0.18519 in the other. With the latter a flat plate that goes
straight down carries 0.8757 xi_n d, which is the 0.876 that the paper states; with the former 0.8750.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["ball_profile", "flat_plate", "function_of", "sideways_capacity", "stress_gradient", "tractions"]

# One row per monomial, in the order of `tractions`; columns f1, f2, f3.
_COEFFICIENTS = np.array(
    [
        (0.00212, -0.06796, -0.02634), (-0.02320, -0.10941, -0.03436), (-0.20890, 0.04725, 0.45256),
        (-0.43083, -0.06914, 0.00835), (-0.00259, -0.05835, 0.02553), (0.48872, -0.65880, -1.31290),
        (-0.00415, -0.11985, -0.05532), (0.07204, -0.25739, 0.06790), (-0.02750, -0.26834, -0.16404),
        (-0.08772, 0.02692, 0.02287), (0.01992, -0.00736, 0.02927), (-0.45961, 0.63758, 0.95406),
        (0.40799, 0.08997, -0.00131), (-0.10107, 0.21069, -0.11028), (-0.06576, 0.04748, 0.01487),
        (0.05664, 0.20406, -0.02730), (-0.09269, 0.18519, 0.10911), (0.01892, 0.04934, -0.04097),
        (0.01033, 0.13527, 0.07881), (0.15120, -0.33207, -0.27519),
    ]
)  # fmt: skip


def stress_gradient(*, bulk_density: float, friction: float, gravity: float) -> float:
    """xi_n [N/m3] of grains of `bulk_density` [kg/m3] and internal friction coefficient `friction` [1]."""
    mu = friction
    return bulk_density * gravity * (894 * mu**3 - 386 * mu**2 + 89 * mu)


def tractions(
    normals: ArrayLike, direction: ArrayLike, *, surface_friction: float, factors: ArrayLike = (1.0, 1.0, 1.0)
) -> NDArray[np.float64]:
    """alpha: the traction on pieces of surface over xi_n times depth [1], shape [n, 3], world axes, z up.

    `normals`: outward, of length 1, shape [n, 3]. `direction`: of the motion, of length 1, shape (3,). Pieces that move
    away from the grains (n.v < 0) bear nothing. `factors`: of f1, f2 and f3, which a fit to other grains changes.
    """
    n = np.asarray(normals, dtype=float)
    v = np.asarray(direction, dtype=float)
    x1, x2, x3 = np.full(len(n), -v[2]), -n[:, 2], n @ v
    monomials = np.stack(
        [
            np.ones(len(n)), x1, x2, x3, x1**2, x2**2, x3**2, x1 * x2, x2 * x3, x3 * x1, x1**3, x2**3, x3**3,
            x1 * x2**2, x2 * x1**2, x2 * x3**2, x3 * x2**2, x3 * x1**2, x1 * x3**2, x1 * x2 * x3,
        ],
        axis=1,
    )  # fmt: skip
    f1, f2, f3 = (monomials @ _COEFFICIENTS).T * np.asarray(factors, dtype=float)[:, None]
    up = np.array([0.0, 0.0, 1.0])
    generic = f1[:, None] * n + f2[:, None] * v - f3[:, None] * up
    normal = -np.einsum("ij,ij->i", generic, n)  # how much it is pushed back along -n
    along = generic + normal[:, None] * n
    normal = np.maximum(normal, 0.0)
    size = np.linalg.norm(along, axis=1)
    held = np.minimum(1.0, surface_friction * normal / np.maximum(size, 1e-300))
    return np.where((x3 >= -1e-12)[:, None], -normal[:, None] * n + held[:, None] * along, 0.0)


_FUNCTION = '''"""Force on a body pushed into {material}: 3D-RFT of plates at {speed:.3g} m/s. Needs numpy."""
import numpy as np

XI, B = np.array({gradients}), {downward}  # of f1, f2, f3 [N/m3]; of surfaces that face down and move down [1]
FRICTION = {friction}  # of grains and body [1]
TABLE = np.array({table})


def force(points, normals, areas, direction):
    """Force [N], shape [3]: middles [m], outward unit normals, areas [m2] of its pieces; surface at z = 0."""
    n, v = np.asarray(normals, float), np.asarray(direction, float) / np.linalg.norm(direction)
    a, b, c = np.full(len(n), -v[2]), -n[:, 2], n @ v
    powers = np.stack([a**0, a, b, c, a*a, b*b, c*c, a*b, b*c, c*a, a**3, b**3, c**3,
                       a*b*b, b*a*a, b*c*c, c*b*b, c*a*a, a*c*c, a*b*c], axis=1)
    f1, f2, f3 = ((1 + B * np.maximum(a, 0) * np.maximum(b, 0)) * (powers @ TABLE * XI).T)[:, :, None]
    t = f1 * n + f2 * v - f3 * np.array([0, 0, 1.0])
    normal = -np.sum(t * n, axis=1, keepdims=True)
    along, normal = t + normal * n, np.maximum(normal, 0)
    held = np.minimum(1, FRICTION * normal / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300))
    depth = np.maximum(-np.asarray(points, float)[:, 2], 0)
    return ((c >= -1e-12) * depth * np.asarray(areas)) @ (held * along - normal * n)
'''


def function_of(factors: ArrayLike, surface_friction: float, material: str, speed: float) -> str:
    """A Python file with a function `force`, for use without this package; `factors` as in `rigid.ground.rft_table`.

    `speed`: of the plates [m/s], which the file states.
    """
    *gradients, downward = [float(f"{f:.6g}") for f in np.asarray(factors)]
    table = np.array2string(_COEFFICIENTS, separator=", ", threshold=1000)
    return _FUNCTION.format(
        material=material, speed=speed, gradients=gradients, downward=downward, friction=surface_friction,
        table=table.replace("\n", "\n                  "),
    )  # fmt: skip


def flat_plate() -> float:
    """alpha_z of a level plate that goes straight down [1]; the paper states 0.876."""
    return float(tractions([[0.0, 0.0, -1.0]], [0.0, 0.0, -1.0], surface_friction=0.0)[0, 2])


def ball_profile(surface_friction: float, *, degree: int = 7, samples: int = 400) -> tuple[NDArray[np.float64], float]:
    """Upward traction on the lower half of a ball going straight down, and on the shaft above it.

    Returns the coefficients g of sum g_k u^k, shape [degree + 1]. It is the least squares fit to alpha_z at u = 1 - cos
    of the angle between normal and downward. At u = 1, a vertical wall, it is exact.
    """
    u = 0.5 * (1.0 - np.cos(np.pi * (np.arange(samples) + 0.5) / samples))  # crowded at the ends, where it bends most
    cosine = 1.0 - u
    sine = np.sqrt(1.0 - cosine**2)
    normals = np.stack([sine, np.zeros(samples), -cosine], axis=1)
    profile = tractions(normals, (0.0, 0.0, -1.0), surface_friction=surface_friction)[:, 2]
    wall = tractions([[1.0, 0.0, 0.0]], (0.0, 0.0, -1.0), surface_friction=surface_friction)[0, 2]
    powers = u[:, None] ** np.arange(degree + 1)
    return np.asarray(np.linalg.lstsq(powers, profile, rcond=None)[0], dtype=np.float64), float(wall)


def sideways_capacity(
    depth: float,
    *,
    radius: float,
    bulk_density: float,
    friction: float,
    surface_friction: float,
    gravity: float,
    count: int = 96,
) -> float:
    """Horizontal force that the grains oppose to a spike moved sideways at `depth` of its tip [N].

    A shaft of `radius` [m] that ends in a ball of the same radius; pieces of surface `count` each way.
    """
    if depth <= 0:
        return 0.0
    angle = 2 * math.pi * (np.arange(count) + 0.5) / count
    down = (1.0 - np.cos(0.5 * math.pi * (np.arange(count) + 0.5) / count)).clip(0, 1)
    edges = 1.0 - np.cos(0.5 * math.pi * np.arange(count + 1) / count)
    force = 0.0
    for u, width in zip(down, np.diff(edges), strict=True):  # rings of the lower half, u = height over radius
        below = depth - radius * u
        if below > 0:
            cosine = 1.0 - u
            sine = math.sqrt(1.0 - cosine**2)
            normals = np.stack([sine * np.cos(angle), sine * np.sin(angle), np.full(count, -cosine)], axis=1)
            mean = tractions(normals, (1.0, 0.0, 0.0), surface_friction=surface_friction)[:, 0].mean()
            force -= mean * below * 2 * math.pi * radius**2 * width
    if depth > radius:
        normals = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
        mean = tractions(normals, (1.0, 0.0, 0.0), surface_friction=surface_friction)[:, 0].mean()
        force -= mean * 2 * math.pi * radius * 0.5 * (depth - radius) ** 2
    return force * stress_gradient(bulk_density=bulk_density, friction=friction, gravity=gravity)
