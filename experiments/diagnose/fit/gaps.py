"""Units of channels and of what replicates differ by, and numerals, as a diagnosis writes them."""

import math

__all__ = ["numeral", "si_unit_of", "size_words", "unit_of"]

#: channel -> (unit, factor on SI)
_UNITS: dict[str, tuple[str, float]] = {
    "x": ("mm", 1e3), "y": ("mm", 1e3), "theta": ("degrees", 180 / math.pi), "gyro": ("rad/s", 1.0),
    "ax": ("m/s2", 1.0), "ay": ("m/s2", 1.0), "wheel": ("rad/s", 1.0), "depth": ("mm", 1e3), "force": ("N", 1.0),
    "accel": ("m/s2", 1.0), "depth zero": ("mm", 1e3), "force zero": ("N", 1.0),
}  # fmt: skip


def unit_of(channel: str) -> tuple[str, float]:
    """The unit in which a channel is reported, and its size in SI units."""
    return _UNITS.get(channel, ("SI", 1.0))


def si_unit_of(channel: str) -> str:
    """The channel's unit in campaign.toml."""
    unit = unit_of(channel)[0]
    return {"mm": "m", "degrees": "rad"}.get(unit, unit)


def size_words(kind: str, size: float) -> str:
    """How much replicates differ by: 3.5 %, or of a channel or a zero 0.09 N."""
    unit, factor = unit_of(kind)
    return f"{100 * size:.2g} %" if unit == "SI" else f"{factor * size:.2g} {unit}"


def numeral(value: float, digits: int = 3) -> str:
    """A number in a sentence: 0.97, 153, 19,400, and powers of ten only from ten millions on."""
    if not 10**digits <= abs(value) < 1e7:
        return f"{value:.{digits}g}"
    return f"{float(f'{value:.{digits - 1}e}'):,.0f}"
