"""What the effects of the library are, and what shows that one of them is really there: a sentence each."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["confirmation", "meaning"]

_MEANINGS = {
    "wheel-vibration": "the spinning wheel shakes the platform and lowers the friction at the spikes",
    "pendulum": "the rig's wires pull the platform back as it moves aside",
    "com-offset": "the centre of mass is not on the axis of rotation",
    "slope": "the surface is not level",
    "tip-radius": "the spikes end in balls, not points, and roll",
    "rig-friction": "the rig's pulleys resist vertical motion",
    "pulley-inertia": "the rig's pulleys have to be turned, which acts as mass in y",
    "torque-fade": "the torque falls with the wheel's speed or with time",
    "inertial-drag": "the surface resists with the square of the tip's speed",
    "depth-hardening": "the force grows other than linearly with depth",
    "plastic-sinkage": "the surface does not spring back all the way",
    "adhesion": "the tip is held as it leaves",
    "rate-friction": "friction depends on the sliding speed",
    "umbilical": "the cable to the platform pulls or drags on its rotation",
    "bearing-drag": "a constant torque acts against the rotation",
    "clock-offset": "the IMU's clock is not the camera's",
    "camera-scale": "the camera measures lengths by another scale",
    "shaft-friction": "something resists the spike's motion in either direction",
    "layering": "the bed changes at a depth",
}

_CONFIRM: Mapping[str, str] = {
    "wheel-vibration": "pull the standing platform sideways with a spring balance, its wheel at rest and at full "
                       "speed: friction should fall with the wheel's speed",
    "pendulum": "hang the rig on longer wires, or time the platform's swing: the pull should go with 1 / length",
    "com-offset": "let the platform turn freely about its shaft: it should come to rest with the centre of mass below; "
                  "balance it, and the effect should vanish",
    "slope": "repeat a trial in the opposite direction: the effect should change its sign",
    "tip-radius": "measure the tips with a calliper, or repeat a trial with pointed ones",
    "rig-friction": "add small weights to the balanced rig until it moves, up and down: half the difference is it",
    "pulley-inertia": "let the balanced rig run under a small known weight: its acceleration tells the mass",
    "torque-fade": "run the wheel on the bench up to its speed here and read the slope of its speed",
    "inertial-drag": "drop one spike at two speeds: the excess force should go with the square",
    "depth-hardening": "press one spike in slowly, deeper than here, and read force over depth",
    "plastic-sinkage": "press one spike in, lift it and measure the mark",
    "adhesion": "lift one spike off slowly and read the pull",
    "rate-friction": "drag one spike over the surface at two speeds a factor of ten apart",
    "umbilical": "remove the cable, or hang it on the other side, and repeat a trial: the effect should vanish, or "
                 "change its sign",
    "bearing-drag": "let the platform turn freely on its shaft and see how fast it slows",
    "clock-offset": "knock on the platform in view of the camera: both should see it that much apart",
    "camera-scale": "film a ruler in the plane of motion",
    "shaft-friction": "move the spike's guide up and down without a bed: a guide's resistance is there too, that of "
                      "a shaft or an edge in the bed is not; for that, push a spike with a rougher side",
    "layering": "open the bed, or push at another place: the change should be at the same depth",
}  # fmt: skip


def meaning(effect: str) -> str:
    """One sentence on what the effect is; empty for one of a person's own."""
    return f"{effect}: {_MEANINGS[effect]}." if effect in _MEANINGS else ""


def confirmation(effect: str) -> str:
    """One sentence: the trial or bench measurement that would show the effect by itself."""
    known = _CONFIRM.get(effect, "change what is thought to cause it and repeat a trial: the effect should follow")
    return f"To confirm {effect}: {known}."
