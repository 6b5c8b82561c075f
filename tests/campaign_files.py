"""Campaign folders as the format's own description has them, for tests to break."""

from pathlib import Path

TUMBLE = """
format = "hedgehog-campaign/1"
kind = "tumble"
name = "brick, October"

[platform]
mass = 5.3             # kg
inertia = 0.06         # kg m2
spike_length = 0.2     # m
[wheel]
inertia = 1.2e-3       # kg m2
[rig]
counterweight = 5.21   # kg
wire_length = 2.2      # m
gravity = 9.80665      # m/s2
[surface]
kind = "brick"
granular = false
stiffness = 1.5e4      # N/m
damping = 60.0         # N s/m
mu_s = 0.5
mu_d = 0.25
[uncertainty]
mass = 0.002
inertia = 0.03
stiffness = 0.1
damping = 0.2
mu_s = 0.05
mu_d = 0.05
gravity_sim = 0.02
[sensors.pose]
std = [0.0005, 0.0005, 0.003]
[sensors.imu]
std = [0.01, 0.02, 0.02]
window = 0.004
[sensors.wheel]
std = [0.5]
[notes]
who = "A. Tester"
dates = [2014-06-17, 2014-06-18]
[notes.room]
temperature = 21.5

[[trial]]
id = "001"
gravity_sim = 0.0834
torque = 0.22
actuator = "motor"
torque_until = 10.0
wheel_speed_0 = 0.0
counterweight = 5.21
pose = "001-pose.csv"
imu = "001-imu.csv"
wheel = "001-wheel.csv"

[[trial]]
id = "002"
gravity_sim = 0.0834
torque = 6.0
actuator = "brake"
wheel_speed_0 = 500.0
pose = "more/002-pose.csv"
"""

POSE = "t_s,x_m,y_m,theta_rad\n-0.1,0.0,0.18,0.0\n0.0,0.0,0.18,0.001\n0.1,nan,,0.002\n0.2,0.01,0.19,0.1\n"
IMU = "t_s,gyro_rad_s,ax_m_s2,ay_m_s2\n0.0,0.0,0.0,9.8\n0.01,0.1,0.01,9.9\n"
WHEEL = "t_s,omega_rad_s\n0.0,0.0\n0.1,0.5\n0.1,0.6\n"

PENETRATION = """
format = "hedgehog-campaign/1"
kind = "penetration"
name = "sand drop tower"

[spike]
mass = 0.5
diameter = 0.012
tip = "sphere"
cone_angle = 60.0
[surface]
kind = "sand"
granular = true
stiffness = 900.0
damping = 4.0
[uncertainty]
stiffness = 0.1
damping = 2.0
[sensors.depth]
std = [0.0002]
[sensors.force]
std = [0.05]
[sensors.accel]
std = [0.1]

[[trial]]
id = "001"
mode = "driven"
gravity = 9.80665
speed = 0.01
diameter = 0.010
data = "001.csv"

[[trial]]
id = "002"
mode = "drop"
gravity = 9.80665
grain_gravity = 1.0
speed = 0.8
data = "002.csv"
"""

DRIVEN = "t_s,depth_m,force_N\n0.0,0.0,0.0\n0.1,0.001,0.9\n"
DROP = "t_s,depth_m,accel_m_s2\n-0.01,-0.008,9.80665\n0.0,0.0,9.80665\n0.1,0.02,-3.0\n"


def tumble_folder(folder: Path) -> Path:
    """A campaign of two tumbles."""
    (folder / "more").mkdir(parents=True)
    (folder / "campaign.toml").write_text(TUMBLE)
    for name, text in (
        ("001-pose.csv", POSE),
        ("001-imu.csv", IMU),
        ("001-wheel.csv", WHEEL),
        ("more/002-pose.csv", POSE),
    ):
        (folder / name).write_text(text)
    return folder


def penetration_folder(folder: Path) -> Path:
    """A campaign of a driven and a dropped spike."""
    folder.mkdir(parents=True)
    (folder / "campaign.toml").write_text(PENETRATION)
    (folder / "001.csv").write_text(DRIVEN)
    (folder / "002.csv").write_text(DROP)
    return folder


def change(path: Path, old: str, new: str) -> None:
    """Replace `old`, which must be there, by `new` in a text file."""
    text = path.read_text()
    assert old in text, old
    path.write_text(text.replace(old, new, 1))
