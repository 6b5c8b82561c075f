"""The race in YADE: a settled bed on a plane, periodic sideways, gravity tilted by 20 degrees.

yade -jTHREADS -x -n bench_yade.py BED OUT SKIN WARM STEPS. It runs in YADE's own Python, so it imports nothing of ours.
BED: a file of LIGGGHTS and LAMMPS: id, type, diameter, density, x, y, z. SKIN: of the broad phase [m]. OUT gets one
line of JSON. The floor is of facets, each smaller than the period, as YADE has no plane in a periodic cell. The cell is
so high that nothing meets its image above.
"""

import json
import math
import os
import sys
import time
from pathlib import Path

from yade import (
    Bo1_Facet_Aabb,
    Bo1_Sphere_Aabb,
    ForceResetter,
    FrictMat,
    Ig2_Facet_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Law2_ScGeom_MindlinPhys_Mindlin,
    NewtonIntegrator,
    O,
    Sphere,
    config,
    utils,
)

bed, out, skin, warm, steps = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5])
rows, period, top = [], [0.0, 0.0], 0.0
with Path(bed).open() as file:
    for line in file:
        words = line.split()
        if len(words) == 4 and words[2] in ("xlo", "ylo"):
            period["xy".index(words[2][0])] = float(words[1])
        elif len(words) == 4 and words[2] == "zlo":
            top = float(words[1])
        elif len(words) == 7:
            rows.append([float(word) for word in words[2:]])

YOUNG, POISSON = 5e7, 0.3
stuff = O.materials.append(FrictMat(young=YOUNG, poisson=POISSON, frictionAngle=math.atan(0.5), density=rows[0][1]))
# The floor of the others is rigid and flat: springs twice those of two grains of the same radii. YADE gives a facet
# twice the radius of the grain, so sqrt(2/3) of a plane's springs. These two numbers are no material: they make YADE's
# means of the two moduli (Ip2_FrictMat_FrictMat_MindlinPhys) larger by both factors, in kno and kso alike.
stiffer = 2 * math.sqrt(1.5)
share = 1 / ((1 - 2 / stiffer) * (1 - POISSON**2))
shear = (2 - POISSON) * share * (1 + POISSON)
poisson = ((4 - POISSON) * stiffer - (2 - POISSON) + shear) / (shear + stiffer)
young = YOUNG * share * (poisson**2 - 1)
rigid = O.materials.append(FrictMat(young=young, poisson=poisson, frictionAngle=math.atan(0.5), density=rows[0][1]))
O.periodic = True
O.cell.setBox(period[0], period[1], 4 * top)
for diameter, _, x, y, z in rows:
    O.bodies.append(utils.sphere((x, y, z + top), diameter / 2, material=stuff))
cuts = 4
a, b = period[0] / cuts, period[1] / cuts
for i in range(cuts):
    for j in range(cuts):
        corners = [((i + p) * a, (j + q) * b, top) for p, q in ((0, 0), (1, 0), (1, 1), (0, 1))]
        O.bodies.append(utils.facet([corners[0], corners[1], corners[2]], material=rigid, fixed=True))
        O.bodies.append(utils.facet([corners[0], corners[2], corners[3]], material=rigid, fixed=True))
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Facet_Aabb()], verletDist=skin),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_MindlinPhys(en=0.5, es=0.5)],
        [Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    NewtonIntegrator(damping=0, gravity=tuple(9.81 * part for part in (0.34202014, 0.0, -0.93969262))),
]
O.dt = 1e-5
O.run(warm, True)
lists = O.engines[1].numAction
began = time.perf_counter()
O.run(steps, True)
took = time.perf_counter() - began
spheres = [body for body in O.bodies if isinstance(body.shape, Sphere)]
touching = sum(
    isinstance(O.bodies[one.id1].shape, Sphere) and isinstance(O.bodies[one.id2].shape, Sphere)
    for one in O.interactions
    if one.isReal
)
with Path(out).open("w") as file:
    json.dump(
        {
            "version": config.version, "time": took, "steps": steps, "grain_count": len(spheres),
            "list_count": O.engines[1].numAction - lists, "missed": 0,
            "kinetic_energy": utils.kineticEnergy(), "coordination": 2 * touching / len(spheres),
            "mean_height": sum(body.state.pos[2] - top for body in spheres) / len(spheres), "period": period,
        },
        file,
    )  # fmt: skip
sys.stdout.flush()
os._exit(0)  # YADE's own end waits for its console
