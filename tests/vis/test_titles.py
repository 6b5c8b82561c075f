"""Pictures name their surface in their titles: of each kind of kept result, of diagnoses, of two runs, of sweeps."""

import json
import shutil
import tomllib
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from PIL import Image

from experiments.sweep.result import shared_title
from vis.compare.report import titles_of
from vis.diagnose.figures import trials_of
from vis.page.plots import title_above
from vis.page.report import Report, title_of
from vis.penetrate.converge import titled

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
KINDS = {
    "tumble": "grains5-rest", "mujoco": "mujoco-hedgehog", "penetrate": "penetrate-sand", "converge": "converge-spike",
    "calibrate": "calibrate-crossed", "bed make": "bed-make-jsc-1a-loose", "bed test plates": "bed-test-plates",
    "bed test cone": "bed-test-cone", "bed test cut": "bed-test-cut-jsc-1a-dense", "bed test repose": "bed-test-repose",
    "bed test shear": "bed-test-shear-sand-dense", "bed calibrate": "calibrate-sand",
}  # fmt: skip


def surfaces() -> set[str]:
    """Names of all surfaces and materials that ship."""
    laws = tomllib.loads((ROOT / "experiments" / "platform" / "surfaces.toml").read_text(encoding="utf-8"))
    return set(laws) | {path.stem for path in (ROOT / "dem" / "presets").glob("*.toml")}


@pytest.mark.parametrize(("kind", "name"), KINDS.items())
def test_the_title_of_each_kind_of_result_names_its_surface(kind: str, name: str) -> None:
    result = json.loads((RESULTS / name / "result.json").read_text(encoding="utf-8"))
    assert result["experiment"] == kind
    assert any(surface in title_of(result) for surface in surfaces())


@pytest.mark.parametrize("kind", ["penetrate", "bed test plates"])
def test_a_title_without_a_gravity_has_that_of_its_beds(kind: str) -> None:
    result = json.loads((RESULTS / KINDS[kind] / "result.json").read_text(encoding="utf-8"))
    assert title_of(result).endswith("at 9.81 m/s\N{SUPERSCRIPT TWO}")


def test_a_figure_of_a_report_has_the_title_on_the_picture(tmp_path: Path) -> None:
    shutil.copyfile(RESULTS / "bed-test-plates" / "result.json", tmp_path / "result.json")
    report, drawing = Report(tmp_path, package="vis.bed", named=True), Figure(figsize=(8.0, 4.0), dpi=50)
    report.draw("plates", drawing)
    assert [text.get_text() for text in drawing.texts] == [title_of(report.result)]
    with Image.open(tmp_path / "figures" / "plates.png") as image:
        assert image.height > 0.5 * image.width  # the picture has grown by the title


def test_a_title_above_leaves_two_axes_of_one_panel_on_each_other() -> None:
    drawing = Figure(figsize=(8.0, 4.0))
    panel, beside = drawing.subplots(1, 2)
    other = panel.twinx()
    title_above(drawing, "A title")
    places = [axis.get_position(original=True).bounds for axis in (panel, other, beside)]
    assert places[0] == pytest.approx(places[1])
    assert places[0][1::2] == pytest.approx(places[2][1::2])


@pytest.mark.parametrize("folder", sorted(path.parent for path in RESULTS.glob("diagnose-*/model.toml")))
def test_figures_of_a_diagnosis_name_surface_gravity_and_what_the_trials_are(folder: Path) -> None:
    title = trials_of(folder)
    assert "sand" in title and "m/s\N{SUPERSCRIPT TWO}: " in title
    assert title.endswith("simulated on grains")


def test_a_diagnosis_without_its_model_has_no_title(tmp_path: Path) -> None:
    assert trials_of(tmp_path) == ""


def test_figures_of_two_runs_have_a_line_for_each_with_its_surface() -> None:
    titles = ["A tumble on a bed of sand: 0.22 N m, rig at 0.08336 m/s2", "A tumble on brick: 0.22 N m, free at 1 m/s2"]
    runs = [{"label": label, "title": title} for label, title in zip(("grains", "law"), titles, strict=True)]
    first, second = titles_of({"runs": runs}).split("\n")
    assert first.startswith("grains: ") and "bed of sand" in first
    assert second.startswith("law: ") and "on brick" in second


@pytest.mark.parametrize(
    ("titles", "shared"),
    [
        (["A tumble on brick: 0.15 N m, rig", "A tumble on brick: 0.2 N m, rig"], "A tumble on brick: rig"),
        (["A tumble on brick: 0.15 N m, rig", "A tumble on brick: rig"], "A tumble on brick"),
        (["A 12 mm spike in sand", "A 12 mm spike in sand"], "A 12 mm spike in sand"),
        (["A tumble on brick: 0.2 N m", "A tumble on steel: 0.2 N m"], ""),
        ([], ""),
    ],
)
def test_the_title_of_a_sweep_is_what_all_its_runs_share(titles: list[str], shared: str) -> None:
    assert shared_title([*(json.dumps({"title": title}) for title in titles), ""]) == shared


def test_the_title_of_a_convergence_has_the_gravity_of_its_settings(tmp_path: Path) -> None:
    for name in ("result.json", "run.toml"):
        shutil.copyfile(RESULTS / "converge-flagship" / name, tmp_path / name)
    title = titled(Report(tmp_path))
    assert "at 9.81 m/s\N{SUPERSCRIPT TWO}" in title
    (tmp_path / "run.toml").unlink()
    assert titled(Report(tmp_path)) == title_of(Report(tmp_path).result)
