"""Lines in the spectrum of what a model leaves, on made-up residuals."""

import math

import numpy as np
import pytest

from experiments.diagnose.noise.spectrum import Piece, line_rows, line_sentence, spectral_lines

RATES = {"x": 120.0, "theta": 120.0, "gyro": 100.0, "ay": 100.0, "wheel": 600.0}
NOISE = 0.02


def pieces(random, *, amplitude=0.0, frequency=14.0, persistence=0.0, drift=0.0):
    """Six trials of 1.8 s: noise, white or coloured; a misfit that wanders and parts at a touch; a line in ay."""
    found = []
    for trial in range(6):
        for channel, rate in RATES.items():
            time = np.arange(0, 1.8, 1 / rate)
            rest = random.standard_normal(len(time))
            for k in range(1, len(time) if persistence else 0):
                rest[k] = persistence * rest[k - 1] + math.sqrt(1 - persistence**2) * rest[k]
            touch = int(len(time) * random.uniform(0.5, 0.9))
            rest += drift * np.cumsum(random.standard_normal(len(time))) / math.sqrt(rate)
            rest[touch:] += 3 * drift * random.standard_normal() * (time[touch:] - time[touch])
            if channel == "ay":
                rest += amplitude * np.sin(2 * math.pi * frequency * time + random.uniform(0, 2 * math.pi))
            phase = np.where(time < 0.9, "slip", "hop")
            found.append(Piece(str(trial), channel, time, rest, NOISE, phase))
    return found


@pytest.mark.parametrize(
    ("persistence", "drift"),
    [*(pytest.param(persistence, 0.0, marks=pytest.mark.long) for persistence in (0.0, 0.6)), (0.6, 5.0)],
)
def test_coloured_noise_and_a_misfit_that_wanders_and_parts_have_no_line(persistence, drift):
    random = np.random.default_rng(5)
    assert [spectral_lines(pieces(random, persistence=persistence, drift=drift)) for _ in range(4)] == [[]] * 4


@pytest.mark.parametrize(("amplitude", "drift"), [(0.6, 0.0), (1.0, 5.0), (4.0, 5.0)])
def test_a_line_is_found_with_its_frequency_amplitude_and_channel_in_every_phase(amplitude, drift):
    (line,) = spectral_lines(pieces(np.random.default_rng(6), amplitude=amplitude, drift=drift, persistence=0.4))
    (part,) = line.parts
    assert line.chance < 1e-3 and part.channel == "ay"
    assert line.frequency == pytest.approx(14.0, abs=4 * line.std) and line.std < 0.1
    assert part.amplitude == pytest.approx(amplitude * NOISE, abs=4 * part.std)
    assert all(size == pytest.approx(part.amplitude, rel=0.4) for size in part.phases.values())
    words = line_sentence(line_rows([line])[0])
    assert "Hz: amplitudes ay" in words and "m/s2" in words and "in phase slip" in words


def test_too_few_rows_have_no_spectrum():
    time = np.linspace(0, 1, 20)
    assert spectral_lines([Piece("1", "ay", time, np.sin(40 * time), NOISE, np.full(20, "hop"))]) == []
