"""The engine's book of what contacts take, against one kept outside it and against the first law."""

from dataclasses import replace

import numpy as np
import pytest

from dem.engine.energy import bed_energies
from experiments.validate.base.energy import record_energy
from experiments.validate.base.spheres import RADIUS, SIXTEEN
from experiments.validate.contacts import cohesion
from experiments.validate.contacts.balances import ROUGH, cluster


def accounts(bed, *, parts, every):
    """Energy held without the springs of friction and turning, and works taken [J], by time; and those springs'."""
    bed.track_contact_work()
    rows = []
    for _ in range(parts + 1):
        held, taken = bed_energies(bed, bodies={}), bed.contact_work
        conserved = held["kinetic"] + held["potential"] + held["normal"]
        rows.append([conserved, *taken.values(), held["tangential"], held["turning"]])
        bed.advance(every)
    return np.array(rows).T


def overlaps(bed):
    """Of all pairs [m], shape [pair]; grains stay away from the boundaries."""
    position, (i, j) = bed.grains().position, np.triu_indices(SIXTEEN, 1)
    return 2 * RADIUS - np.linalg.norm(position[i] - position[j], axis=1)


@pytest.mark.long
def test_the_engines_book_is_the_one_kept_outside_it():
    """Sixteen grains that collide, slide and roll, under gravity; a third to a tenth of the energy goes each way."""
    outside = record_energy(cluster(ROUGH, gravity=(30.0, 0, -100.0), time_step=4e-6), 1000)
    _, damping, sliding, turning, held, wound = accounts(
        cluster(ROUGH, gravity=(30.0, 0, -100.0), time_step=4e-6), parts=50, every=20
    )
    first = outside.parts["kinetic"][0]
    for name, own in (("damped", damping), ("rubbed", sliding - held), ("turned", turning - wound)):
        assert outside.parts[name][-1] > 0.05 * first, name
        assert np.abs(own - outside.parts[name]).max() < 5e-5 * first, name


@pytest.mark.long
def test_what_is_held_and_what_was_taken_is_the_first_energy_to_second_order():
    """Kinetic and Hertz's energy, and the works against dashpots, friction and turning."""
    gaps = []
    for step in (4e-6, 2e-6):
        conserved, *taken, _, _ = accounts(cluster(ROUGH, time_step=step), parts=40, every=round(1e-4 / step))
        total = conserved + np.sum(taken, axis=0)
        assert sum(part[-1] for part in taken) > 0.2 * conserved[0]
        gaps.append(np.abs(total - total[0]).max() / conserved[0])
    assert gaps[0] < 2e-4
    assert gaps[1] < 0.4 * gaps[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dmt", "jkr"])
def test_with_cohesion_it_is_so_but_for_the_first_and_last_step_of_each_contact(name):
    """A pair's force jumps by F_end where it begins and ends; a step that crosses there is right to first order only.

    Velocity Verlet does the work of the mean of the forces at both ends of a step. Where the overlap changes by dx, a
    share f of it in touch, that is F_end dx / 2 instead of F_end f dx: the energy gains F_end (f - 1/2) dx. Taken out,
    what is left is of second order, as without cohesion.
    """
    law = cohesion.Law(name, cohesion.REDUCED["pair"], cohesion.STAR["pair"])
    force_end = law.force(law.end + 1e-9 * law.free)
    assert force_end < -0.5 * law.pull
    whole, rest = [], []
    for step in (4e-6, 2e-6):
        bed = cluster(cohesion._stuff(name), time_step=step)
        bed.track_contact_work()
        totals, jumps, first = [], [0.0], bed_energies(bed, bodies={})["kinetic"]
        before = overlaps(bed)
        for k in range(1, round(4e-3 / step) + 1):
            bed.advance(1)
            after = overlaps(bed)
            crossed = (before > law.end) != (after > law.end)
            change = (after - before)[crossed]
            share = (np.maximum(after, before)[crossed] - law.end) / np.abs(change)
            jumps.append(jumps[-1] + force_end * float(((share - 0.5) * change).sum()))
            before = after
            if k % 50 == 0:
                held, taken = bed_energies(bed, bodies={}), bed.contact_work
                totals.append(held["kinetic"] + held["normal"] + sum(taken.values()))
        gap = np.array(totals) / first - 1
        whole.append(np.abs(gap).max())
        rest.append(np.abs(gap - np.array(jumps[50::50]) / first).max())
        assert sum(taken.values()) > 0.2 * first
    assert whole[0] < 2e-4
    assert rest[1] < 0.4 * rest[0]


def test_a_bed_without_a_book_says_how_to_open_one():
    with pytest.raises(ValueError, match=r"tracks no contact work.*track_contact_work\(\) starts it"):
        _ = cluster(ROUGH, time_step=4e-6).contact_work


def made(bed):
    """What friction, and rolling with twisting, made over what they took."""
    work = bed.friction_work
    return np.array([work[f"{part}_made"] / work[f"{part}_lost"] for part in ("tangential", "turning")])


@pytest.mark.long
def test_rescaled_springs_make_no_energy_in_a_cluster_and_displacement_springs_do():
    """Sixteen grains that collide, slide and roll; what is lost, less what is made, is what the book has."""
    found = {}
    for law in ("rescaled", "displacement"):
        _, _, sliding, turning, held, wound = accounts(
            bed := cluster(replace(ROUGH, tangential=law), time_step=4e-6), parts=4, every=250
        )
        work, found[law] = bed.friction_work, made(bed)
        for part, own in (("tangential", sliding - held), ("turning", turning - wound)):
            assert work[f"{part}_lost"] - work[f"{part}_made"] == pytest.approx(own[-1], rel=2e-3), part
    assert found["rescaled"].max() < 1e-3
    assert found["displacement"].max() > 5e-3
