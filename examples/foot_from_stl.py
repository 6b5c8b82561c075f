"""Push a foot of any shape, read from an STL file, into a bed of sand."""

import sys
from pathlib import Path

import meshio
import numpy as np

from dem import Bed, mesh_from_file

small = "--small" in sys.argv
width, grain = (0.012, 0.004) if small else (0.030, 0.003)  # of the foot, of a grain [m]
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples")
out.mkdir(parents=True, exist_ok=True)

# A foot as a CAD program writes it: here a pyramid that stands on its point, in millimetres.
corners = 1e3 * width * np.array([[0, 0, 0], [1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]]) * (0.5, 0.5, 1.0)
faces = np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [1, 2, 3], [1, 3, 4]])
meshio.write(out / "foot.stl", meshio.Mesh(corners, [("triangle", faces)]))

foot = mesh_from_file(out / "foot.stl", scale=1e-3)
bed = Bed.prepare("sand", size=(2 * width, 2 * width, 1.5 * width), grain=grain, gravity=9.81, seed=1, young=3e7)
body = bed.add_body([foot], position=(width, width, bed.surface + 0.5 * grain), friction=0.5)
bed.move_body(body, velocity=(0.0, 0.0, -0.1))
forces = []
while bed.body_position(body)[2] > bed.surface - 0.5 * width:
    bed.advance(100)
    forces.append(bed.reaction(body)[0][2])
print(f"foot of {1e6 * foot.volume:.2f} cm3, {5e2 * width:.1f} mm deep: mean of the last tenth", end=" ")
print(f"{np.mean(forces[-len(forces) // 10 :]):.2f} N")

assert np.isclose(foot.volume, width**3 / 3, rtol=1e-5), "the volume of a pyramid"
assert np.mean(forces[-len(forces) // 10 :]) > np.mean(forces[: len(forces) // 10]) >= 0, "the deeper, the harder"
