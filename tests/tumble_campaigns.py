"""Campaigns of tumbles for tests of diagnose: the accurate integrator through the rig's sensors."""

from experiments.campaign import Campaign, Recording, TumbleCampaign
from experiments.tumble.synthesis import record
from rigid import Trial
from rigid.sensors import SensorSet

NOMINAL = {"mass": 5.3, "inertia": 0.06, "stiffness": 1.5e4, "damping": 60.0, "mu_s": 0.5, "mu_d": 0.25}
SIGMA = {"mass": 0.002, "inertia": 0.03, "stiffness": 0.1, "damping": 0.2, "mu_s": 0.05, "mu_d": 0.05}
CONDITIONS = (
    {"torque": 0.22, "gravity_sim": 0.0834},
    {"torque": 0.22, "gravity_sim": 0.147},
    {"torque": 6.0, "gravity_sim": 0.0834, "actuator": "brake", "wheel_speed_0": 300.0},
    {"torque": 0.125, "gravity_sim": 0.0834},
)


def campaign(
    *, effects=(), seed=None, off=0.0, conditions=CONDITIONS, duration=1.2, window=0.004, friction=(),
    nominal=NOMINAL, sigma=SIGMA, away=None,
) -> Campaign:  # fmt: skip
    """Trials of the accurate integrator through the rig's sensors, true numbers `off` sigmas away from those stated
    (`away`: each by its own), and each trial's own factor on both coefficients of friction."""
    true = {name: value * (1 + (away or {}).get(name, off) * sigma[name]) for name, value in nominal.items()}
    sensors = SensorSet(imu_window=window)
    recordings, trials = {}, []
    for number, condition in enumerate(conditions, 1):
        gravity = condition["gravity_sim"] * (1 + 0.02 * off * (-1) ** number)
        rubs = friction[number - 1] if friction else 1.0
        mine = true | {name: rubs * true[name] for name in ("mu_s", "mu_d")}
        trial = Trial(**({"counterweight": 5.2} | condition | mine | {"gravity_sim": gravity}), effects=effects)
        own = None if seed is None else (seed, number)
        measured, _ = record(trial, duration=duration, sensors=sensors, seed=own)
        id = f"{number:03d}"
        for sensor in ("pose", "imu", "wheel"):
            recordings[id, sensor] = Recording(getattr(measured, sensor))
        files = {sensor: f"{id}-{sensor}.csv" for sensor in ("pose", "imu", "wheel")}
        trials.append({"id": id, "actuator": "motor", "counterweight": 5.2, **condition, **files})
    tables = {
        "format": "hedgehog-campaign/1", "kind": "tumble", "name": "test",
        "platform": {"mass": nominal["mass"], "inertia": nominal["inertia"], "spike_length": 0.2},
        "wheel": {"inertia": 1.2e-3},
        "rig": {"counterweight": 5.2},
        "surface": {"kind": "brick", **{key: nominal[key] for key in ("stiffness", "damping", "mu_s", "mu_d")}},
        "uncertainty": sigma | {"gravity_sim": 0.02},
        "sensors": {"pose": {"std": (5e-4, 5e-4, 3e-3)}, "imu": {"std": (0.01, 0.02, 0.02), "window": window},
                    "wheel": {"std": (0.5,)}},
        "trial": tuple(trials),
    }  # fmt: skip
    return Campaign(TumbleCampaign(**tables), recordings)
