"""`hedgebed bed calibrate`: known answers of made-up responses and stresses, the material's file, what is refused."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import vis
from dem import BedFailure
from dem.grains.materials import MATERIALS, material, read_material
from dem.measure.element import ElementShear
from experiments.calibrate import experiment as calibrate
from experiments.calibrate import tests as calibrate_tests
from experiments.calibrate.fit import Response, Wanted, design, find_best, next_point
from experiments.calibrate.settings import CalibrateSettings, Target, material_at
from experiments.calibrate.tests import SampleTest, figures_of, summary_of, triaxial_angle
from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.runs.folder import RunFolder

ANGLE = {"value": 31.0, "tolerance": 1.0, "source": "made up"}
CUT = {"value": 0.022, "tolerance": 0.005, "source": "made up"}
DENSITY = {"value": 1637.0, "tolerance": 45.0, "source": "made up", "fit": False}
COHESION = {"value": 200.0, "tolerance": 20.0, "source": "made up"}


def sand(**options):
    given = {"name": "mine", "free": {"rolling_friction": (0.0, 0.8)}, "targets": {"critical_friction_angle": ANGLE}}
    return CalibrateSettings(**given | options)


def sticky(**options):
    free = {"rolling_friction": (0.0, 0.8), "surface_energy": (0.05, 1.0)}
    targets = {"critical_friction_angle": ANGLE, "cohesion": COHESION}
    return sand(**{"free": free, "targets": targets, "fixed": {"cohesion": "dmt"}} | options)


def angle_at(rolling):
    """Made up: what grains do, that rises and levels off."""
    return 22 + 14 * (1 - np.exp(-rolling / 0.25))


def made_up_run(stuff, pressure, seed):
    """A sheared sample whose shear stress is c + tan(angle) normal; its stress ratio scatters by 2 %."""
    angle = math.radians(angle_at(stuff.rolling_friction))
    cohesion = 250 * stuff.surface_energy
    n = 400
    ratio = (math.tan(angle) + cohesion / pressure) * (1 + 0.02 * np.random.default_rng(seed).standard_normal(n))
    normal = np.full(n, pressure)
    stress = pressure * np.diag([1.0, 1.0, 1.0])[None].repeat(20, axis=0)
    strain = np.linspace(0, 1.2, n)
    inside = np.linspace(0, 1.2, 20)
    return ElementShear(
        strain, 0 * strain, ratio * normal, normal, inside, 0 * inside, stress, pressure, 5e-3, 0.57, 1e6, 100, 0.03
    )


def test_the_answer_of_a_made_up_response_is_found_within_its_uncertainty():
    """Two parameters, two figures, noise of seeds: the truth lies within two standard deviations, of less than a third
    of the range; and no more points are asked for once the surfaces are known to half a tolerance."""
    ranges = {"rolling_friction": (0.0, 0.8), "surface_energy": (0.05, 1.0)}
    truth = np.array([0.28, 0.62])

    def figures(p):
        return {"angle": angle_at(p[..., 0]) + 0.5 * p[..., 1], "cohesion": 280 * p[..., 1] * (1 + 0.2 * p[..., 0])}

    wanted = {name: Wanted(float(v), t) for (name, v), t in zip(figures(truth).items(), (1.0, 20.0), strict=True)}
    rng, noise = np.random.default_rng(1), {"angle": 0.3, "cohesion": 6.0}
    points, found = design(ranges, 7, seed=1), []
    for _ in range(4):
        while len(found) < len(points):
            found.append({k: v + noise[k] * rng.standard_normal() for k, v in figures(points[len(found)]).items()})
        x = (points - [0, 0.05]) / [0.8, 0.95]
        surfaces = {k: Response(x, np.array([f[k] for f in found]), np.full(len(x), 0.5 * noise[k])) for k in wanted}
        more = next_point(surfaces, wanted, ranges, points, enough=0.5)
        if more is None:
            break
        points = np.vstack([points, more])
    fit = find_best(surfaces, wanted, ranges)
    assert more is None and not fit.at_edge and not fit.vague
    assert (np.abs(fit.best - truth) < 2 * fit.std).all() and (fit.std < np.array([0.8, 0.95]) / 3).all()
    assert fit.chi2 < 0.1


def test_a_figure_out_of_reach_puts_the_parameter_at_its_edge():
    x = np.linspace(0, 1, 6)[:, None]
    surface = {"angle": Response(x, angle_at(0.8 * x[:, 0]), np.full(6, 0.1))}
    fit = find_best(surface, {"angle": Wanted(45.0, 1.0)}, {"rolling_friction": (0.0, 0.8)})
    assert fit.at_edge == {"rolling_friction": "upper"} and fit.chi2 > 20


def test_friction_angle_and_cohesion_are_those_of_the_line_through_the_tests():
    """tau = 120 Pa + sigma tan 30 degrees, exactly; errors of 5 Pa make sqrt(2) 5 / 700 of slope."""
    targets = [
        Target("critical_friction_angle", 1, 1, "", "critical_friction_angle", "shear", "loose"),
        Target("cohesion", 1, 1, "", "cohesion", "shear", "loose"),
    ]
    tangent = math.tan(math.radians(30))
    runs = {SampleTest("loose", p, 1): {"normal": p, "shear": 120 + p * tangent, "error": 5.0} for p in (300.0, 1000.0)}
    found = figures_of(targets, runs)
    assert found["critical_friction_angle"][0] == pytest.approx(30) and found["cohesion"][0] == pytest.approx(120)
    slope_error = math.sqrt(2) * 5 / 700
    assert found["critical_friction_angle"][1] == pytest.approx(math.degrees(slope_error / (1 + tangent**2)))
    assert found["cohesion"][1] == pytest.approx(5 / 700 * math.hypot(1000, 300))
    whole = Target("whole", 1, 1, "", "critical_friction_angle", "shear", "loose", through="origin")
    steeper = tangent + 120 * 1300 / (300**2 + 1000**2)  # least squares without a cohesion
    assert figures_of([whole], runs)["whole"][0] == pytest.approx(math.degrees(math.atan(steeper)))


def test_cohesion_and_angle_of_mohrs_circle_are_those_of_coulombs_wedge():
    """s1 = 2 c cos / (1 - sin) + s3 (1 + sin) / (1 - sin): 190 Pa and 47 degrees come back, pulled sideways or not."""
    sine, cosine = math.sin(math.radians(47)), math.cos(math.radians(47))
    runs = {}
    for p, least in ((300.0, -35.0), (1000.0, 160.0)):
        most = (2 * 190 * cosine + least * (1 + sine)) / (1 - sine)
        tensor = np.diag([least, 0.3 * (least + most), most])
        summary = {"peak_normal": p, "peak_shear": p, "error": 5.0, "peak_tensor": tensor.tolist()}
        runs[SampleTest("loose", p, 1)] = summary
    targets = [Target(figure, 1, 1, "", figure, "mohr", "loose") for figure in ("peak_friction_angle", "peak_cohesion")]
    found = figures_of(targets, runs)
    assert found["peak_friction_angle"][0] == pytest.approx(47) and found["peak_cohesion"][0] == pytest.approx(190)


def test_an_angle_of_repose_needs_one_bed_and_no_pressures():
    settings = sticky(targets=sticky().targets | {"angle_of_repose": ANGLE})
    tests = calibrate_tests.tests_for(settings, list(settings.wanted.values()), seed=7)
    assert [test.name for test in tests] == ["loose-500-seed7", "loose-1000-seed7", "drained-seed7"]
    found = figures_of([settings.wanted["angle_of_repose"]], {tests[-1]: {"angle": 33.0, "error": 0.7}})
    assert found["angle_of_repose"] == pytest.approx((33.0, 0.7))
    with pytest.raises(ValueError, match=r"repose_size, times grain: size: x = 0\.08 m is too narrow"):
        calibrate.check(settings.model_copy(update={"repose_size": (20.0, 6.0, 8.0)}))
    calibrate.check(settings)
    shallow = settings.model_copy(update={"repose_size": (92.0, 6.0, 19.0)})
    with pytest.raises(ValueError, match=r"repose_size = 92 6 19: .* targets.angle_of_repose.fit = false"):
        calibrate.check(shallow)
    calibrate.check(shallow.model_copy(update={"targets": {"angle_of_repose": ANGLE | {"fit": False}}}))


def test_a_cut_height_needs_one_bed_and_no_pressures():
    settings = sticky(targets=sticky().targets | {"cut_height": CUT, "cut_density": DENSITY})
    tests = calibrate_tests.tests_for(settings, list(settings.wanted.values()), seed=7)
    assert [test.name for test in tests] == ["loose-500-seed7", "loose-1000-seed7", "cut-seed7"]
    kept = {"cut_height": 0.020, "error": 0.001, "bulk_density": 1640.0}
    found = figures_of([settings.wanted["cut_height"], settings.wanted["cut_density"]], {tests[-1]: kept})
    assert found == {"cut_height": pytest.approx((0.020, 0.001)), "cut_density": (1640.0, 0.0)}
    calibrate.check(settings)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"cut_size": (12.0, 6.0, 7.0)}, r"cut_size, times grain: width = 0\.012 m of the cut"),
        ({"cut_size": (24.0, 3.0, 7.0)}, r"cut_size, times grain: size: y = 0\.012 m"),
        ({"cut_stages": ("rain:dry", "stick")}, "cut_stages = rain:dry stick: 'level'"),
        ({"cut_stages": ("rain:dry", "stik", "level")}, "cut_stages: .*'stik'"),
        ({"cut_stages": ("rain:dry", "level")}, "'stick'"),
    ],
)
def test_a_bed_in_which_nothing_can_be_cut_is_refused(options, said):
    targets = sticky().targets | {"cut_height": CUT}
    with pytest.raises(ValueError, match=said):
        calibrate.check(sticky(targets=targets, **options))


@pytest.mark.long
def test_faces_of_grains_that_stick_more_stand_higher():
    """H = 4 c / (rho g) tan(45 + phi / 2) (Terzaghi 1943), c in proportion to the surface energy: thirty times as much
    of it stands at least eight times as high in one thin bed, whose grains decide by how much."""
    settings = sticky(
        fixed={"cohesion": "dmt", "rolling_friction": 1.2},
        free={"surface_energy": (0.002, 0.3)},
        targets={"cut_height": CUT},
        cut_size=(17.0, 6.0, 5.0),
        threads=1,
    )
    heights = []
    for energy in (0.004, 0.12):
        stuff = material_at(settings, {"surface_energy": energy})
        found, series = calibrate_tests.run_test(stuff, SampleTest("cut", 0.0, 4), settings, tell=lambda share: None)
        assert found["stood"] < found["cut_height"] < found["fell"] and found["bulk_density"] > 0.4 * stuff.density
        assert found["error"] == pytest.approx((found["fell"] - found["stood"]) / math.sqrt(12))
        assert series["thickness_m"].max() > 0.8 * found["height"]
        heights.append(found["cut_height"])
    assert heights[1] > 8 * heights[0]


def test_a_packing_out_of_reach_stops_the_calibration_and_names_the_stages(monkeypatch):
    def refuse(*_, **__):
        raise ValueError("packing = 0.62 was not reached")

    monkeypatch.setattr(calibrate_tests.Bed, "prepare_as", refuse)
    settings = sticky(targets=sticky().targets | {"cut_height": CUT})
    with pytest.raises(BedFailure, match=r"cut_stages: packing = 0\.62"):
        calibrate_tests.run_test(settings.base, SampleTest("cut", 0.0, 1), settings, tell=lambda share: None)


def test_a_face_that_never_falls_stops_the_calibration(monkeypatch):
    bed = SimpleNamespace(packing_fraction=0.5, grain_count=9)
    stood = SimpleNamespace(fell=None, stood=4.0, height=0.02)
    monkeypatch.setattr(calibrate_tests.Bed, "prepare_as", lambda *_, **__: SimpleNamespace(whole=bed))
    monkeypatch.setattr(calibrate_tests, "cut_and_load", lambda *_, **__: stood)
    settings = sticky(targets=sticky().targets | {"cut_height": CUT})
    with pytest.raises(BedFailure, match="surface_energy or a greater depth in cut_size"):
        calibrate_tests.run_test(settings.base, SampleTest("cut", 0.0, 1), settings, tell=lambda share: None)


def test_the_triaxial_angle_of_triaxial_compression_is_its_own():
    """sigma_1 / sigma_3 = (1 + sin) / (1 - sin); plane strain of the same invariants is stronger (Matsuoka & Nakai)."""
    sine = math.sin(math.radians(31))
    major = (1 + sine) / (1 - sine)
    assert triaxial_angle(np.diag([1.0, 1.0, major])) == pytest.approx(31)
    assert triaxial_angle(np.diag([0.5, 0.5, major - 0.5]), added=0.5) == pytest.approx(31)
    assert triaxial_angle(np.diag([1.0, 1.5, major])) < 31
    with pytest.raises(ValueError, match="none that presses"):
        triaxial_angle(np.diag([-1.0, 1.0, 1.0]))


def test_samples_are_as_stiff_as_asked(monkeypatch):
    asked = {}

    def shear_element(stuff, **options):
        asked.update(options)
        return made_up_run(stuff, options["pressure"], options["seed"])

    monkeypatch.setattr(calibrate_tests, "shear_element", shear_element)
    settings = sand(max_overlap=0.02)
    stuff = material_at(settings, {"rolling_friction": 0.25})
    calibrate_tests.run_test(stuff, SampleTest("loose", 500.0, 1), settings, tell=lambda share: None)
    assert asked["max_overlap"] == 0.02 and asked["pressure"] == 500.0


def test_the_strength_of_a_sample_is_the_mean_of_its_second_half():
    run = made_up_run(material_at(sand(), {"rolling_friction": 0.25}), 1000.0, 1)
    found = summary_of(run, 2650.0)
    wanted = 1000 * math.tan(math.radians(angle_at(0.25)))
    assert found["shear"] == pytest.approx(wanted, abs=4 * found["error"]) and found["error"] < 0.01 * wanted
    assert found["bulk_density"] == pytest.approx(0.57 * 2650)


def test_a_calibration_finds_the_grains_and_resumes(tmp_path, monkeypatch, capsys):
    """The tests replaced by ones that obey a law: angle and cohesion come out, the file is read, a second go simulates
    nothing; what was to be compared only and is not met is said."""
    calls = []

    def run_test(stuff, test, settings, *, tell):
        calls.append(test)
        run = made_up_run(stuff, test.pressure, 1000 * len(calls))
        return summary_of(run, stuff.density), {c: getattr(run, k) for k, c in calibrate_tests._COLUMNS.items()}

    monkeypatch.setattr(calibrate, "run_test", run_test)
    ring = {"figure": "critical_friction_angle", "value": 50.0, "tolerance": 2.0, "source": "made up", "fit": False}
    settings = sticky(points=7, most_points=9, targets=sticky().targets | {"ring": ring})
    out = tmp_path / "run"
    result = calibrate.run(settings, out)
    figures = {entry["name"]: entry for entry in result["figures"]}
    assert figures["critical_friction_angle"]["verdict"] == figures["cohesion"]["verdict"] == "met"
    assert figures["ring"]["verdict"] == "not met" and any("ring = 31" in w for w in result["warnings"])
    page = (out / "report.html").read_text()
    assert vis.write_report(out).read_text() == page and "Figure by figure" in page  # and again, as `render` does
    rolling = result["quantities"]["rolling_friction"]
    assert angle_at(rolling["value"]) == pytest.approx(31, abs=1) and 0 < rolling["std"] < 0.2
    assert result["quantities"]["surface_energy"]["value"] == pytest.approx(0.8, abs=0.1)
    stuff = read_material(out / "material.toml")
    assert stuff == material_at(settings, {k: result["quantities"][k]["value"] for k in settings.free})
    assert stuff.grain == 0.004 and material(out / "material.toml", grain=0.002).surface_energy == pytest.approx(
        0.5 * stuff.surface_energy
    )
    count = len(calls)
    report = (out / "report.html").read_text()
    monkeypatch.setattr("vis.bed.calibrate.write_calibration_report", lambda folder, progress: None)
    assert calibrate.resume(out)["quantities"] == json.loads((out / "result.json").read_text())["quantities"]
    assert len(calls) == count
    for name in ("response-rolling_friction", "response-surface_energy", "residuals", "tests"):
        assert (out / "figures" / f"{name}.png").exists(), name
    assert "Figure by figure" in report


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"targets": {"critical_angle": ANGLE}}, "targets.critical_angle is no figure: did you mean"),
        ({"targets": {"critical_friction_angle": {"value": 31.0}}}, "tolerance must be given"),
        ({"targets": {"critical_friction_angle": ANGLE | {"tolerance": 0}}}, "tolerance = 0 must be positive"),
        ({"targets": {"critical_friction_angle": ANGLE | {"value": 95}}}, "value = 95 .* at least 0 and below 90"),
        (
            {"targets": {"critical_friction_angle": ANGLE | {"plane": "oblique"}}},
            "must be 'shear', 'triaxial' or 'mohr'",
        ),
        ({"targets": {"sample_density": ANGLE | {"plane": "mohr"}}}, "'shear' or 'mohr' of a cohesion"),
        ({"targets": {"angle_of_repose": ANGLE | {"state": "loose"}}}, "state = 'loose' must be"),
        ({"targets": {"cohesion": COHESION | {"through": "origin"}}}, "through = 'origin' must be"),
        ({"targets": {"packing_loose": ANGLE | {"fit": True}}}, "takes minutes and is compared only"),
        ({"targets": {"cohesion": COHESION}}, "of grains that do not stick"),
        ({"targets": {"cut_height": CUT}}, "of grains that do not stick"),
        ({"targets": {"cut_height": CUT | {"state": "loose"}}}, "state = 'loose' must be"),
        ({"free": {"rolling": (0.1, 0.2)}}, "free.rolling is no parameter that can be found"),
        ({"free": {"rolling_friction": (0.5, 0.2)}}, "the smaller first"),
        ({"free": {"friction": (0.1, 0.5), "rolling_friction": (0.1, 0.5)}}, "1 figures to fit"),
        ({"free": {"surface_energy": (0.1, 0.5)}}, "needs a law"),
        ({"fixed": {"colour": 3.0}}, "fixed.colour is no number of a material"),
        ({"check_seeds": (1, 2)}, "a seed of exploring"),
        ({"samples": 3, "check_seeds": (3,)}, "check_seeds holds 3"),
        ({"most_points": 4}, "at least 3 points"),
        ({"name": "sand"}, "name = 'sand' is that of the material it starts from"),
    ],
)
def test_targets_that_will_not_do_are_refused(options, said):
    with pytest.raises(ValueError, match=said.replace("(", r"\(")):
        sand(**options)


def test_a_bond_number_is_a_surface_energy():
    """DMT: 4 pi gamma R* over rho g pi d^3 / 6 with R* = d / 4 (docs/bed.md, Cohesion)."""
    settings = sticky(free={"rolling_friction": (0.0, 0.8), "bond_number": (1.0, 20.0)})
    stuff = material_at(settings, {"rolling_friction": 0.2, "bond_number": 10.0})
    pull = 4 * math.pi * stuff.surface_energy * 0.001
    assert pull == pytest.approx(10 * 2650 * 9.80665 * math.pi * 0.004**3 / 6)


FILE = """format = "hedgebed-material/1"
name = "mine"
density = 2650.0
young = 70e9
poisson = 0.25
friction = 0.5
restitution = 0.5
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("format =", "is not TOML"),
        (FILE.replace("material/1", "material/9"), "format = 'hedgebed-material/9'"),
        (FILE + "rolling = 0.1\n", "rolling = 0.1 is no key of a material; did you mean 'rolling_friction'"),
        (FILE.replace("density = 2650.0\n", ""), "density must be given"),
        (FILE.replace("2650.0", "true"), "density = True must be a number"),
        (FILE.replace("mine", "My sand"), "cannot name a material"),
        (FILE.replace('"mine"', '"sand"'), "is that of a material that ships, with other numbers"),
        (FILE.replace("poisson = 0.25", "poisson = 0.6"), "poisson = 0.6 must be"),
    ],
)
def test_a_material_file_that_will_not_do_is_refused(text, said, tmp_path):
    path = tmp_path / "material.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=said):
        material(str(path))


def test_a_material_file_is_taken_where_a_name_is(tmp_path, capsys):
    path = tmp_path / "material.toml"
    path.write_text(FILE + 'cohesion = "dmt"\nsurface_energy = 0.4\ngrain = 0.004\n')
    assert material(path).for_grain(0.001).surface_energy == pytest.approx(0.1)
    assert (
        main(["bed", "make", "--material", str(path), "--young", "1e12", "--out", str(tmp_path / "run")]) == BAD_INPUT
    )
    assert "young = 1e+12" in capsys.readouterr().err
    assert main(["bed", "make", "--material", "nowhere.toml", "--out", str(tmp_path / "run")]) == BAD_INPUT
    assert "'nowhere.toml'" in capsys.readouterr().err


def test_every_material_that_ships_reads_and_says_where_its_numbers_are_from():
    for name, stuff in MATERIALS.items():
        numbers = {"density", "young", "poisson", "friction", "restitution", "rolling_friction"}
        assert stuff.name == name and set(stuff.sources) >= numbers | (
            {"surface_energy"} if stuff.cohesion != "none" else set()
        )
        assert (stuff.grain is not None) == (stuff.cohesion != "none")


@pytest.mark.slow
def test_a_small_sample_is_calibrated_from_the_command_line(tmp_path):
    """End to end with few grains: rough ones are stronger than ones that roll, and the run says what it found."""
    case = tmp_path / "target.toml"
    case.write_text(
        'name = "mine"\nsize = [6.0, 6.0, 6.0]\nstrain = 0.4\ninertial_number = 0.02\npoints = 3\nmost_points = 3\n'
        "check_seeds = [2]\n[free]\nrolling_friction = [0.0, 0.6]\n[targets.critical_friction_angle]\nvalue = 27.0\n"
        'tolerance = 2.0\nsource = "made up"\n'
    )
    out = tmp_path / "run"
    assert main(["bed", "calibrate", str(case), "--threads", "1", "--quiet", "--out", str(out)]) == DONE
    result = json.loads((out / "result.json").read_text())
    found = [point["figures"]["critical_friction_angle"][0] for point in result["points"]]
    assert 18 < found[0] < found[-1] < 40
    assert RunFolder.open(out).status == "done" and read_material(out / "material.toml").name == "mine"
    assert calibrate_tests.tests_for(sand(), list(sand().wanted.values()), seed=3) == [SampleTest("loose", 1000.0, 3)]
