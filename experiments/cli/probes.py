"""Small trials that may crash, hang or print: `experiments.cli.doctor` runs this file in a process of its own.

``python -P probes.py taichi cpu`` and ``python -P probes.py opengl`` print one JSON object as their last line.
"""

import json
import sys
from typing import NotRequired, TypedDict

__all__ = ["Answer", "try_opengl", "try_taichi"]


class Answer(TypedDict):
    """What a trial found."""

    ok: bool
    reason: str  # Why it is not ok; "" where it is
    version: NotRequired[str]  # Of the library
    renderer: NotRequired[str]  # Of OpenGL


def try_taichi(arch: str) -> Answer:
    """Start Taichi on `arch` (cpu, cuda or vulkan), run a kernel, and say whether the sum came out."""
    from hedgebed_taichi import ti
    from hedgebed_taichi import version as taichi_version

    version = taichi_version()
    try:
        ti.init(arch=getattr(ti, arch), log_level=ti.ERROR, offline_cache=False)
    except Exception as error:
        return {"version": version, "ok": False, "reason": str(error).splitlines()[0]}
    started = str(ti.lang.impl.current_cfg().arch).removeprefix("Arch.")
    if (arch == "cpu") != (started in ("x64", "arm64")) or (arch != "cpu" and started != arch):
        return {"version": version, "ok": False, "reason": f"Taichi fell back to {started}"}

    @ti.kernel
    def add() -> ti.i32:
        total = 0
        for i in range(1000):
            total += i
        return total

    total = add()
    ok = total == 499500
    return {"version": version, "ok": ok, "reason": "" if ok else f"the sum of 0..999 came out as {total}"}


def try_opengl() -> Answer:
    """Draw a small ball off screen and say whether there is anything in the picture."""
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
    plotter.add_mesh(pyvista.Sphere(), color="white")
    plotter.background_color = "black"
    picture = plotter.screenshot(return_img=True)
    renderer = plotter.render_window.ReportCapabilities() or ""
    named = [line.split(":", 1)[1].strip() for line in renderer.splitlines() if line.startswith("OpenGL renderer")]
    plotter.close()
    ok = picture is not None and int(picture.max()) > int(picture.min())
    return {
        "version": pyvista.__version__,
        "renderer": named[0] if named else "",
        "ok": ok,
        "reason": "" if ok else "the picture is blank",
    }


if __name__ == "__main__":
    print(json.dumps(try_taichi(sys.argv[2]) if sys.argv[1] == "taichi" else try_opengl()))
