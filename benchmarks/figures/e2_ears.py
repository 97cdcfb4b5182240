"""E2: exploring one face after another, each glued to what is known."""

from itertools import pairwise

import numpy as np

from benchmarks.figures import drawing
from benchmarks.figures.findings import Finding
from benchmarks.figures.runs import Run, explored
from gvgbot.geometry import Array

WORLD = "jittered:1"
SHOWN = 6  # ears
TOLD = ("loop_closed", "vertex_added", "decision")


def find() -> Finding:
    ears, nearest = explored(WORLD, "exploration.policy=ears"), explored(WORLD)
    figure, (left, right) = drawing.stage(1, 2, (10.0, 4.6))
    drawing.walls(left, ears.world, color=drawing.PALE)
    truth = ears.trajectory("truth")
    stamps = [0.0, *(closure["stamp"] for closure in ears.trace["closures"])]
    colours = drawing.shades(SHOWN)
    for number in range(SHOWN):
        part = (truth.stamps >= stamps[number]) & (truth.stamps <= stamps[number + 1])
        left.plot(*truth.poses[part, :2].T, color=colours[number], lw=2.2)
        left.annotate(str(number + 1), truth.poses[part, :2][part.sum() // 2], fontsize=9)
    drawing.labelled(left, f"the first {SHOWN} closures by the ear rule")
    gaps = {"ears": _gaps(ears), "nearest": _gaps(nearest)}
    for name, metres in gaps.items():
        share = np.arange(1, len(metres) + 1) / len(metres)
        right.step(np.sort(metres), share, where="post", label=f"{name}: {len(metres)} closures")
    right.legend(fontsize=8)
    drawing.labelled(right, "way from closure to closure", "m", "share of closures")
    closed, goes_on = _continued(ears)
    rows = [
        (
            name,
            f"{run.summary['distance_m']:.0f}",
            str(len(gaps[name])),
            f"{gaps[name].mean():.1f}",
            f"{gaps[name].max():.0f}",
        )
        for name, run in (("ears", ears), ("nearest", nearest))
    ]
    return Finding(
        title="Ears",
        claim="Taking the next edge in one rotational sense explores one face after another, and "
        "comes back to mapped ground at regular intervals.",
        verdict=f"After {goes_on} of the {closed} closures that another ear followed at once, it "
        f"began at the same vertex. From closure to closure it is {rows[0][3]} m on average and "
        f"{rows[0][4]} m at most; with the nearest frontier, {rows[1][3]} and {rows[1][4]} m.",
        holds=goes_on == closed,
        figure=drawing.save(figure, "e2"),
        explained=f"`{WORLD}`, both with scan matching. Left: the way from closure to closure, "
        "numbered. Right: how long such ways are.",
        table=(("policy", "way, m", "closures", "mean m between", "most"), *rows),
    )


def _gaps(run: Run) -> Array:
    """Metres from closure to closure."""
    return np.diff([0.0, *(closure["travelled"] for closure in run.trace["closures"])])


def _continued(run: Run) -> tuple[int, int]:
    """Closures that were followed by an ear somewhere, and those by one at the same vertex."""
    told = [e for e in run.events if e["event"] in TOLD]
    pairs = [
        (first["vertex"], then["vertex"])
        for first, then in pairwise(told)
        if first["event"] == "loop_closed" and then.get("reason") == "ear"
    ]
    return len(pairs), sum(closed == begun for closed, begun in pairs)
