"""The sensors against motions whose readings have a closed form (conventions: planar model, sensors)."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rigid.sensors import Motion, SensorSet, measure, sensor_times

G, G_SIM = 9.80665, 0.0834
SENSORS = SensorSet(lead=0.1)


def motion(time, **parts):
    """A motion that stands still but for what is given."""
    zeros = np.zeros_like(time)
    return Motion(time=time, **dict.fromkeys(("x", "y", "theta", "vx", "vy", "omega", "wheel_speed"), zeros) | parts)


def pivoting(time, *, rate, length=0.2, angle=math.pi / 8):
    """About a tip that stays where it is: the centre is at l (sin gamma, cos gamma) of it, gamma = angle + rate t."""
    gamma = angle + rate * time
    return motion(
        time,
        x=length * np.sin(gamma),
        y=length * np.cos(gamma),
        theta=rate * time,
        vx=length * rate * np.cos(gamma),
        vy=-length * rate * np.sin(gamma),
        omega=np.full_like(time, rate),
        ax=-length * rate**2 * np.sin(gamma),
        ay=-length * rate**2 * np.cos(gamma),
    )


def hopping(time, *, rate, gravity, speed=0.2):
    """A spinning body in free fall at `gravity`."""
    return motion(
        time,
        x=speed * time,
        y=0.2 + speed * time - 0.5 * gravity * time**2,
        theta=rate * time,
        vx=np.full_like(time, speed),
        vy=speed - gravity * time,
        omega=np.full_like(time, rate),
        ax=np.zeros_like(time),
        ay=np.full_like(time, -gravity),
    )


def test_rows_come_at_the_rates_of_the_rig_from_before_the_start_to_the_end():
    recorded = measure(motion(sensor_times(SENSORS, 1.0)), SENSORS, gravity_local=G)
    for rows, rate in ((recorded.pose, 120), (recorded.imu, 100), (recorded.wheel, 600)):
        assert rows["t_s"][0] == pytest.approx(-0.1, abs=1 / rate)
        assert np.diff(rows["t_s"]) == pytest.approx(1 / rate, rel=1e-9)
        assert 0.0 in rows["t_s"]
    assert recorded.pose["t_s"][-1] == 1.0
    assert recorded.imu["t_s"][-1] == 0.99  # the window of a row at 1 s would reach past the end


@pytest.mark.parametrize("gravity", [G, G_SIM], ids=["rig", "free"])
def test_at_rest_the_imu_reads_the_local_gravity_upwards(gravity):
    recorded = measure(motion(sensor_times(SENSORS, 0.5)), SENSORS, gravity_local=gravity)
    assert recorded.imu["ax_m_s2"] == pytest.approx(0.0, abs=1e-12)
    assert recorded.imu["ay_m_s2"] == pytest.approx(gravity, rel=1e-12)


@pytest.mark.parametrize("window", [0.0, 0.004])
def test_at_rest_on_a_slope_the_imu_reads_the_vertical(window):
    sensors, angle = replace(SENSORS, imu_window=window), 0.1
    time = sensor_times(sensors, 0.5)
    still = motion(time, ax=0.0 * time, ay=0.0 * time)
    recorded = measure(still, sensors, gravity_local=G, up=(math.sin(angle), math.cos(angle)))
    assert recorded.imu["ax_m_s2"] == pytest.approx(G * math.sin(angle), rel=1e-12)
    assert recorded.imu["ay_m_s2"] == pytest.approx(G * math.cos(angle), rel=1e-12)


def test_in_a_free_hop_the_imu_reads_nothing_without_a_rig():
    time = sensor_times(SENSORS, 0.5)
    recorded = measure(hopping(time, rate=2.0, gravity=G_SIM), SENSORS, gravity_local=G_SIM)
    later = recorded.imu["t_s"] > 0.01
    # The centre's turning is integrated by trapezoids of 1 ms: h^2 / 12 omega^3 v is below 1e-6 m/s2.
    assert recorded.imu["ax_m_s2"][later] == pytest.approx(0.0, abs=1e-6)
    assert recorded.imu["ay_m_s2"][later] == pytest.approx(0.0, abs=1e-6)


def test_in_the_rig_a_hop_leaves_what_the_wires_carry_turned_into_body_axes_and_averaged():
    time, rate, window = sensor_times(SENSORS, 0.5), 2.0, 0.004
    recorded = measure(hopping(time, rate=rate, gravity=G_SIM), SENSORS, gravity_local=G)
    at = recorded.imu["t_s"]
    later = at > 0.01
    low, high = rate * (at[later] - window / 2), rate * (at[later] + window / 2)
    # Means of (g_loc - g_sim) (-sin theta, cos theta) over the window.
    kept = (G - G_SIM) / (rate * window)
    assert recorded.imu["ax_m_s2"][later] == pytest.approx(kept * (np.cos(high) - np.cos(low)), abs=1e-5)
    assert recorded.imu["ay_m_s2"][later] == pytest.approx(kept * (np.sin(high) - np.sin(low)), abs=1e-5)


def test_on_a_pivot_the_imu_reads_the_centripetal_pull_along_the_spike():
    rate, length, angle = 1.5, 0.2, math.pi / 8
    for window in (0.0, 0.004):
        sensors = replace(SENSORS, imu_window=window)
        run = pivoting(sensor_times(sensors, 0.5), rate=rate)
        recorded = measure(run, sensors, gravity_local=0.0)
        later = recorded.imu["t_s"] > 0.01
        # a = -l omega^2 (sin gamma, cos gamma) in the world, and gamma - theta is fixed in the body.
        assert recorded.imu["ax_m_s2"][later] == pytest.approx(-length * rate**2 * math.sin(angle), abs=1e-5)
        assert recorded.imu["ay_m_s2"][later] == pytest.approx(-length * rate**2 * math.cos(angle), abs=1e-5)
        assert recorded.imu["gyro_rad_s"][later] == pytest.approx(rate)


def test_a_window_across_a_jump_of_the_force_holds_its_share_exactly():
    # At rest, then pushed along x at 2 m/s2 from 0.2013 s on: the row at 0.2 s sees 0.7 ms of it in a window of 4 ms.
    start, pushed = 0.2013, 2.0
    time = sensor_times(SENSORS, 0.5)
    since = np.maximum(0.0, time - start)
    recorded = measure(motion(time, vx=pushed * since, x=0.5 * pushed * since**2), SENSORS, gravity_local=G)
    row = np.argmin(np.abs(recorded.imu["t_s"] - 0.2))
    assert recorded.imu["ax_m_s2"][row] == pytest.approx(pushed * 0.7 / 4, rel=1e-9)


def test_the_camera_reads_the_geometric_centre_with_its_zero_and_scale():
    time = sensor_times(SENSORS, 0.5)
    run = motion(time, x=0.1 * time, y=0.2 - 0.05 * time, theta=2.0 * time)
    camera = replace(SENSORS, camera_scale=1.02, camera_bend=0.5)
    recorded = measure(run, camera, gravity_local=G, camera_zero=(0.001, -0.002, 0.003))
    at = np.maximum(recorded.pose["t_s"], 0.0)
    scale = 1.02 + 0.5 * (0.1**2 + 0.05**2) * at**2
    assert recorded.pose["x_m"] == pytest.approx(scale * 0.1 * at + 0.001, abs=1e-12)
    assert recorded.pose["y_m"] == pytest.approx(scale * (0.2 - 0.05 * at) - 0.002, abs=1e-12)
    assert recorded.pose["theta_rad"] == pytest.approx(2.0 * at + 0.003, abs=1e-12)


@pytest.mark.parametrize(("offset", "drift"), [(0.012, 0.0), (-0.012, 0.0), (0.012, 0.05)])
def test_a_clock_that_is_ahead_writes_what_happened_later_than_it_did(offset, drift):
    sensors = replace(SENSORS, clock_offset=offset, clock_drift=drift)
    time = sensor_times(sensors, 0.5)
    recorded = measure(motion(time, omega=3.0 * time, theta=1.5 * time**2), sensors, gravity_local=G)
    # Written less true time is the offset and what was gained since: t shows the gyro of (t - offset) / (1 + gain).
    expected = 3.0 * np.maximum(0.0, (recorded.imu["t_s"] - offset) / (1 + drift))
    assert recorded.imu["gyro_rad_s"] == pytest.approx(expected, abs=1e-12)


def test_the_wheel_is_read_without_its_sign():
    time = sensor_times(SENSORS, 0.5)
    recorded = measure(motion(time, wheel_speed=-100.0 * time), SENSORS, gravity_local=G)
    assert recorded.wheel["omega_rad_s"] == pytest.approx(100 * np.maximum(recorded.wheel["t_s"], 0), abs=1e-9)


def test_noise_has_the_stated_size_and_comes_from_the_seed():
    time = np.linspace(0.0, 40.0, 2001)
    run = motion(time)
    zero = (0.0, 0.0, 0.0)
    first, again, other = (measure(run, SENSORS, gravity_local=G, seed=s, camera_zero=zero) for s in (1, 1, 2))
    bare = measure(run, SENSORS, gravity_local=G)
    for sensor, stds in (("pose", SENSORS.pose_std), ("imu", SENSORS.imu_std), ("wheel", (SENSORS.wheel_std,))):
        a, b, c, none = (getattr(record, sensor) for record in (first, again, other, bare))
        for name, std in zip(list(a)[1:], stds, strict=True):
            noise = (a[name] - none[name]) / std
            assert np.array_equal(a[name], b[name])
            assert not np.array_equal(a[name], c[name])
            # Five standard errors of mean and of standard deviation.
            assert abs(noise.mean()) < 5 / math.sqrt(len(noise))
            assert abs(noise.std() - 1) < 5 / math.sqrt(2 * len(noise))


def test_the_zero_of_the_camera_stays_within_three_std():
    run = motion(np.linspace(0.0, 0.1, 5))
    zeros = np.array([measure(run, SENSORS, gravity_local=G, seed=(7, k)).camera_zero for k in range(200)])
    bound = 3 * np.array(SENSORS.pose_std)
    assert (np.abs(zeros) <= bound).all()
    assert (np.abs(zeros).max(axis=0) > 0.9 * bound).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"imu_rate": 0.0}, "imu_rate = 0"),
        ({"wheel_std": -1.0}, "wheel_std = -1"),
        ({"pose_std": (0.1, -0.1, 0.1)}, "pose_std"),
        ({"pose_std": (0.1, 0.1)}, "three numbers"),
        ({"imu_window": -0.1}, "imu_window"),
        ({"camera_scale": 0.0}, "camera_scale"),
        ({"clock_offset": math.nan}, "clock_offset = nan"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused_by_name(change, said):
    with pytest.raises(ValueError, match=said):
        SensorSet(**change)


def test_a_motion_that_cannot_be_is_refused_by_name():
    with pytest.raises(ValueError, match="time must begin at 0"):
        motion(np.array([0.1, 0.2]))
    with pytest.raises(ValueError, match="time must begin at 0 and rise"):
        motion(np.array([0.0, 0.2, 0.2]))
    with pytest.raises(ValueError, match="x has shape"):
        motion(np.array([0.0, 0.2]), x=np.zeros(3))
    with pytest.raises(ValueError, match="accelerations"):
        measure(motion(np.array([0.0, 0.2])), replace(SENSORS, imu_window=0.0), gravity_local=G)
