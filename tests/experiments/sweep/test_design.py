"""The runs of a sweep: lists, ranges, intervals, tables, and what is refused before any run."""

import numpy as np
import pytest

from experiments.runs.reading import Layer, settings_from
from experiments.sweep.design import design_of
from experiments.sweep.settings import SweepSettings


def design(**given):
    values = {"experiment": "tumble", "fixed": ["rig=0.0085"]} | given
    return design_of(settings_from(SweepSettings, [Layer("sweep.toml", values)]), check=True)


def refused(**given):
    with pytest.raises(ValueError) as caught:
        design(**given)
    return str(caught.value)


def test_lists_and_ranges_make_all_combinations_in_order():
    made = design(over=["torque=0.1:0.2:0.05", "mu_s=[0.4, 0.5]"])
    assert [tuple(point.values.values()) for point in made.points] == [
        (0.1, 0.4), (0.1, 0.5), (0.15, 0.4), (0.15, 0.5), (0.2, 0.4), (0.2, 0.5),
    ]  # fmt: skip
    last = made.points[-1].settings
    assert (last.torque, last.mu_s, last.rig) == (0.2, 0.5, 0.0085)


def test_a_table_of_the_file_is_what_the_command_line_takes():
    typed = settings_from(
        SweepSettings, [Layer(None, {"experiment": "hop", "over": ("mu_s=[0.4, 0.5]", "torque=1:2")})]
    )
    written = {"experiment": "hop", "over": {"mu_s": [0.4, 0.5], "torque": "1:2"}}
    points = [design_of(settings).points for settings in (typed, SweepSettings(**written))]
    assert points[0] == points[1] and len(points[0]) == 128


def test_a_unit_may_follow_the_numbers_of_a_range():
    made = design(over=["gravity=1mg:3mg:1mg"], fixed=[])
    assert [point.settings.gravity for point in made.points] == pytest.approx([9.80665e-3 * k for k in (1, 2, 3)])


def test_a_latin_hypercube_has_one_sample_in_each_stratum_of_every_setting():
    """McKay, Beckman and Conover, Technometrics 21 (1979) 239-245; in the logarithm where that is asked for."""
    made = design(over=["torque=0.1:0.2", "mu_s=0.3:0.6", "rig=1e-3:1e-2:log"], fixed=[], samples=40)
    values = np.array([list(point.values.values()) for point in made.points])
    values[:, 2] = np.log10(values[:, 2])
    shares = (values - (0.1, 0.3, -3)) / (0.1, 0.3, 1)
    for column in shares.T:
        assert sorted((40 * column).astype(int)) == list(range(40))


def test_saltellis_design_differs_in_one_setting_from_a_sample_to_the_next_of_its_block():
    pytest.importorskip("SALib")
    made = design(over=["torque=0.1:0.2", "mu_s=0.3:0.6"], samples=8, sampling="sobol")
    blocks = made.shares.reshape(8, 4, 2)
    assert len(made.points) == 32
    assert ((blocks[:, 1] != blocks[:, 0]).sum(axis=1) == 1).all() and ((blocks[:, 3] != blocks[:, 0]).all())


def test_samples_are_combined_with_lists():
    made = design(over=["torque=0.1:0.2", "mu_s=[0.4, 0.5]"], samples=5)
    assert [point.sample for point in made.points] == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert [point.cell for point in made.points] == [0, 1] * 5


def test_a_table_gives_a_run_for_each_row_and_leaves_empty_cells_to_the_rest(tmp_path):
    (tmp_path / "rows.csv").write_text("torque,surface,effects\n0.2,brick,\n,sand,\"['pendulum.length=2.2']\"\n")
    points = design(table=str(tmp_path / "rows.csv")).points
    assert [point.settings.torque for point in points] == [0.2, None]
    assert [point.settings.surface for point in points] == ["brick", "sand"]
    assert points[1].settings.effects == ("pendulum.length=2.2",)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"over": ["torqe=[1, 2]"]}, ("torqe", "torque")),
        ({"over": ["torque=0.2"]}, ("torque=0.2", "fixed")),
        ({"over": ["torque=0.2:0.1:0.05"]}, ("torque=0.2:0.1:0.05", "FROM below TO")),
        ({"over": ["torque=-1:1:log"]}, ("torque=-1:1:log", "above 0")),
        ({"over": ["torque=0.1:0.2:0"]}, ("STEP = 0",)),
        ({"over": ["torque=0.1:0.2:1e-9"]}, ("STEP = 1e-09",)),
        ({"over": ["torque=[]"]}, ("empty",)),
        ({"over": ["torque=[0.1, 0.1]"]}, ("twice",)),
        ({"over": ["torque=[0.1]", "torque=[0.2]"]}, ("torque twice",)),
        ({"over": ["torque=1kg:2kg:1kg"]}, ("1kg",)),
        ({"over": ["tumbles=1:3"]}, ("whole number",)),
        ({"over": ["rig=[0.01, 0.02]"]}, ("rig", "fixed", "over")),
        ({"over": ["mu_s=[0.4, -0.5]"]}, ("run 2 of 2", "mu_s = -0.5")),
        ({"over": ["torque=[0.2, 0.5, 0.5001]"]}, ("run 2 of 3", "torque = 0.5 N m")),
        ({"over": ["torque=0.1:0.2:1e-5", "mu_s=0.3:0.4:1e-4"]}, ("10,011,001",)),
        ({"over": ["torque"]}, ("'torque'", "KEY=VALUE")),
        ({"fixed": ["rig=0.01", "rig=0.02"], "over": ["torque=[0.1]"]}, ("rig twice",)),
        ({}, ("nothing is varied",)),
        ({"experiment": "sweep", "over": ["torque=[0.1]"]}, ("'sweep'", "tumble")),
        ({"experiment": "jump", "over": ["torque=[0.1]"]}, ("'jump'", "tumble")),
        ({"over": ["torque=[0.1]"], "sampling": "sobol", "samples": 48}, ("samples = 48", "power of two")),
        ({"over": ["torque=[0.1]"], "scheduler": "tcp://a:1", "workers": 2}, ("workers = 2", "scheduler")),
        ({"table": "nowhere.csv"}, ("nowhere.csv", "no such file")),
    ],
)
def test_what_cannot_be_swept_is_refused_by_key_and_value(given, words):
    said = refused(**given)
    assert [word for word in words if word not in said] == [] and "Traceback" not in said


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("torque\n", ("no rows",)),
        ("torqe\n1\n", ("torqe", "torque")),
        ("torque,\n0.1,2\n", ("rows.csv", "no name")),
        ("torque,torque\n1,2\n", ("twice",)),
        ("torque,mu_s\n0.1,0.4\n0.2\n", ("rows.csv:3", "1 cells", "2")),
        ("rig\n0.01\n", ("rig", "fixed")),
        ("torque\nmuch\n", ("torque", "much")),
    ],
)
def test_a_table_that_will_not_do_is_refused_by_file_and_line(text, words, tmp_path):
    (tmp_path / "rows.csv").write_text(text)
    said = refused(table=str(tmp_path / "rows.csv"))
    assert [word for word in words if word not in said] == []
