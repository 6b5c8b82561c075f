"""Diagnosing tumbles with one thread and with several."""

import subprocess
import sys
from pathlib import Path

SCRIPT = """
import hashlib, sys
import numpy as np
from hedgebed_taichi import ti
from tumble_campaigns import CONDITIONS, campaign
from experiments.diagnose.fit import together
from experiments.diagnose.fit.fitting import Model, Whitener
from experiments.diagnose.tumble.data import tumble_data
from experiments.diagnose.tumble.forward import Forward
from experiments.diagnose.tumble.problem import TumbleProblem

data = tumble_data(campaign(conditions=CONDITIONS[:3]))
for threads in (1, 3):
    ti.reset()
    together.cores_there = lambda: threads
    count = 70  # more than one piece of each trial, and clocks of their own
    sets = {"mass": np.linspace(0.5, 1.01, count) * data.tables.platform.mass}
    clocks = {"clock-offset.offset": np.linspace(-1e-3, 1e-3, count)}
    told = hashlib.sha256()
    for given, horizon in ((sets, 1.0), (sets | clocks, 1.0), (sets, 0.4)):
        for found in Forward(data, threads=threads).predict(given, motion=True, horizon=horizon):
            told.update(found.value.tobytes() + found.state.tobytes() + found.motion.tobytes())
    problem = TumbleProblem(data, threads=threads)
    model = Model(problem, Whitener.white(problem), tuple(trial.id for trial in problem.trials))
    points = [{"mass": float(mass)} for mass in sets["mass"]]
    told.update(np.stack(model.evaluate(points)).tobytes())
    workers = ti.lang.impl.current_cfg().cpu_max_num_threads
    print(workers, bool(together._pool.cache_info().currsize), told.hexdigest())
"""


def test_the_same_bits_come_out_however_many_threads_simulate_and_read():
    """Predictions, states, motions and the modes that are fitted, of lanes that share nothing; a process of its own,
    since Taichi has as many threads as it was started with."""
    here = Path(__file__).parents[2]
    environment = {"PYTHONPATH": f"{here.parent}:{here}", "PATH": "", "HOME": str(Path.home())}
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    one, three = (line.split() for line in done.stdout.splitlines() if not line.startswith("["))
    assert one[:2] == ["1", "False"] and three[:2] == ["3", "True"]
    assert one[2] == three[2]
