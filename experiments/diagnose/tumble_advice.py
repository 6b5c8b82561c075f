"""Which measurement tells two of a tumble's effects apart: one bench measurement or trial for each effect."""

from __future__ import annotations

__all__ = ["advice"]

_BENCH = {
    "wheel-vibration": "pull the standing platform sideways with a spring balance, its wheel at rest and at full speed",
    "pendulum": "push the hanging platform 0.1 m aside and time its swing, or measure the wires' free length",
    "com-offset": "let the platform turn freely about its shaft and see in which attitude it comes to rest",
    "slope": "lay a spirit level or the unmoved IMU on the surface, or repeat a trial in the opposite direction",
    "tip-radius": "measure the balls at the tips with a calliper",
    "rig-friction": "add small weights to the balanced rig until it moves, up and down",
    "pulley-inertia": "let the balanced rig fall under a small known weight and compare two weights",
    "torque-fade": "run the wheel on the bench and read its speed up to the end: its slope is the torque",
    "inertial-drag": "drop one spike onto the surface at two speeds",
    "depth-hardening": "press one spike in slowly and read force over depth",
    "plastic-sinkage": "press one spike in and lift it again, and see how deep the mark is",
    "adhesion": "lift one spike off slowly and read the pull",
    "rate-friction": "drag one spike over the surface at two speeds",
    "umbilical": "repeat a trial with the cable hanging on the other side, or without it",
    "bearing-drag": "let the platform turn freely on its shaft and see how fast it slows",
    "clock-offset": "knock on the platform: camera and IMU see the same instant",
    "camera-scale": "film a ruler",
}


def advice(first: str, second: str) -> str:
    """One sentence for two effects by their ids."""
    told = _BENCH.get(first), _BENCH.get(second)
    if None not in told:
        return f"To tell {first} from {second}: {told[0]} ({first}), and {told[1]} ({second})."
    known = next((text for text in told if text is not None), "repeat the trials at another torque and gravity")
    return f"To tell {first} from {second}: {known}."
