"""The equations that are told of the library's forms are those that are computed."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments.diagnose.core import effect_texts as texts
from experiments.diagnose.core.effect_texts import (
    PENETRATION,
    TUMBLE,
    equation,
    equations_of,
    form_meaning,
    with_comments,
)
from experiments.diagnose.fit.forms import shapes_of
from experiments.diagnose.push.forms import Scales, physical, push_forms
from experiments.diagnose.push.law import push
from experiments.diagnose.push.slots import SLOTS, slot_table
from experiments.diagnose.tumble import forms as tumble
from rigid.terms import CANDIDATES, EFFECTS
from rigid.terms.candidate import Typical

K, C, DEEPEST, SPEED, D, H = 900.0, 4.0, 0.02, 0.05, 0.015, 0.006
SCALES = Scales(depth=D, speed=SPEED, force=K * D)
LIBRARY = push_forms(retreats=True, speeds_differ=True, drops=True)
SHAPES = shapes_of(LIBRARY, again=True)
FORMS = {form.id: form for form in (*LIBRARY, *(form for bent in SHAPES.values() for form in bent))}


def numbers_of(form) -> dict[str, float]:
    """The form's slots, at a place where it changes the force by some tens of per cent."""
    plain = next((FORMS[plain] for plain, bent in SHAPES.items() if form in bent), form)
    start = {p.name: p.value for p in form.parameters} | dict(plain.starts[0]) | dict((form.starts or ({},))[0])
    start[form.amplitude] = start[form.amplitude] or 0.2
    start |= {"depth-hardening.hardening_steeper": 0.4, "plastic-sinkage.crater_bend": 0.7}
    return {
        form.slots[p.name].name: physical(form.slots[p.name], start[p.name], SCALES, stiffness=K, size=1.0)
        for p in form.parameters
    }


def computed(numbers: dict[str, float], depth: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """The compiled law along a path."""
    table = slot_table(1)
    known = {"stiffness": K, "damping": C, "reference": D, "radius_depth": H, "speed_scale": 1e-6, "mass": 1.0}
    for name, value in (known | numbers).items():
        table[0, SLOTS.index(name)] = value
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(depth) / speed[1:]))])
    ends = np.array([0, len(depth)], dtype=np.int32)
    return push(table, np.zeros(1, dtype=np.int32), ends, depth, speed, times=times)[0]


def told(form_id: str, numbers: dict[str, float], z: float, v: float, deepest: float, loading=None) -> float:
    """The same by the equation; `loading`: force of the way down over depth, K z if not given."""
    text = PENETRATION[form_id]
    first, *clauses = re.split(r", (?![^(]*\))", text)  # not within parentheses
    names = numbers | {
        "K": K, "D": D, "H": H, "z": z, "v": v, "z_m": deepest, "r": deepest - z, "exp": math.exp, "min": min,
        "max": max, "abs": abs, "sign": np.sign, "tanh": math.tanh, "f": loading or (lambda depth: K * depth),
    }  # fmt: skip
    if form_id.startswith("shaft-friction:mobilised over a way"):  # dw = (sign(dz) - w) |dz| / reach, solved
        reach = numbers["shaft_reach"]
        top = 1 - math.exp(-deepest / reach)
        names["w"] = 1 - math.exp(-z / reach) if v > 0 else -1 + (top + 1) * math.exp(-(deepest - z) / reach)
        clauses = [clause for clause in clauses if not clause.startswith("dw")]
    if form_id.startswith("relaxation"):  # de/dt, solved along the path: in at SPEED, out at 0.4 SPEED
        clauses, rate = [], clauses[0].partition(" = ")[2].replace("^", "**")

        def slope(t, e):
            here = SPEED * t if t <= DEEPEST / SPEED else DEEPEST - 0.4 * SPEED * (t - DEEPEST / SPEED)
            return eval(rate, {}, names | {"z": max(here, 1e-12), "e": e[0]})

        until = z / SPEED if v > 0 else DEEPEST / SPEED + (DEEPEST - z) / (0.4 * SPEED)
        names["e"] = solve_ivp(slope, (0, until), [0.0], rtol=1e-8, atol=1e-14, max_step=2e-3).y[0, -1]
        if "relax_fast" in numbers and v < 0:  # tau is longer than the way back lasts
            names["e"] = min(names["e"], numbers["relax_fast"] / (1 + numbers["relax_fast"]) * z)
    for clause in clauses:
        name, _, right = clause.partition(" = ")
        if right:
            names[name] = eval(right.split(";")[0].replace("^", "**"), {}, names)
    value = float(eval(first.strip("+ ").replace("^", "**"), {}, names))
    base = C * max(v, 0.0)
    if first[0] in "+-":
        return base + K * z + value
    return base + (max(value, 0.0) if "way back" in text else value)


@pytest.mark.parametrize("form_id", sorted(FORMS))
def test_the_equation_of_a_push_is_what_is_computed(form_id):
    numbers = numbers_of(FORMS[form_id])
    numbers["layer_width"] = numbers.get("layer_width", 1e-3) if form_id != "layering:slope" else 1e-5
    depth = np.concatenate([np.linspace(1e-6, DEEPEST, 2001), np.linspace(DEEPEST, 0.012, 801)[1:]])
    speed = np.where(np.arange(len(depth)) <= 2000, SPEED, -0.4 * SPEED)
    force = computed(numbers, depth, speed)
    going_in = "way back" in PENETRATION[form_id] or "way out" in PENETRATION[form_id] or "r /" in PENETRATION[form_id]
    for row in (300, 1200, 1900, 2020, 2250, 2600):
        z, v, deepest = float(depth[row]), float(speed[row]), float(depth[: row + 1].max())
        out = row > 2000
        if (going_in and not out) or ("goes in" in PENETRATION[form_id] and out):
            assert force[row] == pytest.approx(K * z + C * max(v, 0.0), rel=1e-9)  # the base model
        else:
            assert force[row] == pytest.approx(told(form_id, numbers, z, v, deepest), rel=2e-3, abs=1e-6)
            assert abs(force[row] - K * z - C * max(v, 0.0)) > 0 or form_id.startswith("layering")


@pytest.mark.parametrize("unloading", ["stiffer unloading", "crater", "curved crater"])
def test_beside_hardening_the_equation_of_the_way_back_starts_from_the_hardened_force(unloading):
    hardening, sinking = "depth-hardening:quadratic", f"plastic-sinkage:{unloading}"
    hard, soft = numbers_of(FORMS[hardening]), numbers_of(FORMS[sinking])
    depth = np.concatenate([np.linspace(1e-6, DEEPEST, 2001), np.linspace(DEEPEST, 0.012, 801)[1:]])
    speed = np.where(np.arange(len(depth)) <= 2000, SPEED, -0.4 * SPEED)
    force = computed(hard | soft, depth, speed)

    def loading(z):
        return told(hardening, hard, z, 0.0, z)

    for row in (2020, 2250):
        z = float(depth[row])
        assert force[row] == pytest.approx(told(sinking, soft, z, float(speed[row]), DEEPEST, loading), rel=2e-3)


def test_every_form_has_an_equation_in_the_names_of_its_parameters():
    for form in FORMS.values():
        said = equation("penetration", form)
        missing = [slot.name for slot in form.numbers if slot.name not in said]
        assert said and not missing, (form.id, missing)
    forms = tumble.tumble_forms(rig=True, sinkage=1e-3, weight=1.0)
    for form in (*forms, *(form for bent in shapes_of(forms).values() for form in bent)):
        values = {p.name: np.array(0.1) for p in form.parameters}
        said = equation("tumble", form)
        missing = [name for key in tumble.physical(form, values) if (name := key.partition(".")[2]) not in said]
        assert said and not missing, (form.id, missing)
    assert set(TUMBLE) <= set(EFFECTS)


def test_model_toml_has_the_equation_above_each_effect_and_reads_as_before():
    text = 'format = "x"\n\n[[effect]]\nid = "a"\n\n[[effect]]\nid = "mine"\n'
    shaft = FORMS["shaft-friction:constant"]
    mine = SimpleNamespace(id="mine:own", effect="mine", name="own", stiffness="")
    rows = equations_of("penetration", [shaft, mine], lambda form: {"shaft": "N"})
    commented = with_comments(text, rows, "penetration")
    assert "# shaft-friction (constant): + shaft * sign(v); shaft [N]\n[[effect]]" in commented
    assert "# mine (own):" in commented and "# F is" in commented
    assert tomllib.loads(commented) == tomllib.loads(text)
    assert with_comments("x = 1\n", [], "penetration") == "x = 1\n"


def test_every_form_has_a_clause_and_those_of_pushes_are_in_the_glossary():
    """Reports print its name; bends have theirs behind a comma, and nothing in the table is of no form."""
    named: dict[str, set[str]] = {}
    typical = Typical(sinkage=1e-3, weight=1.0)
    for effect, found in CANDIDATES.items():
        forms = [*(found.push.forms if found.push else ()), *(found.tumble.forms(typical) if found.tumble else ())]
        bends = [*(found.push.bends if found.push else ()), *(found.tumble.bends if found.tumble else ())]
        parts = {part for one in (*forms, *bends) for part in one.name.removeprefix("{}, ").split(", ")}
        named[effect] = parts
        assert all(form_meaning(f"{effect}:{part}") for part in parts), effect
    table = tomllib.loads(Path(texts.__file__).with_name("forms.toml").read_text(encoding="utf-8"))
    assert {effect: set(forms) for effect, forms in table.items()} == named
    glossary = (Path(__file__).parents[3] / "docs/glossary.md").read_text(encoding="utf-8")
    lines = {line[2:].split(":")[0].split(",")[0].split(" ")[0]: line for line in glossary.splitlines()}
    for id in FORMS:
        effect, _, name = id.partition(":")
        assert all(f"**{part}**" in lines[effect] for part in name.split(", ")), id
    assert form_meaning("plastic-sinkage:crater, empty").count(";") == 2 and form_meaning("mine:own") == ""
