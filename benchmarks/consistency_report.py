"""What runs of benchmarks.consistency have in common: lines, means in their bands, plots."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

Row = dict[str, Any]

COLUMNS = (  # key, degrees of freedom
    ("pose_nees", 3),
    ("vertex_nees", 2),
    ("filter_vertex_nees", 2),
    ("closure_nees", 3),
)


def line(row: Row) -> str:
    """A run in a line."""
    nees = " ".join("    -" if row[k] is None else f"{row[k]:5.2f}" for k, _ in COLUMNS)
    rmse = row["vertex_rmse_m"]
    return (
        f"{row['name']:32} {row['outcome'] or '-':10.10} {nees}  end {row['end_error_m']:.3f}  "
        f"rmse {'-' if rmse is None else f'{rmse:.3f}'}  closed {row['closures']}, "
        f"wrong {row['wrong']}, twice {row['twice']}, recognised {_recognised([row])}  "
        f"{row['cpu_s']:.0f} s"
    )


def summary(rows: list[Row]) -> list[str]:
    """Means over the runs of each profile and all, with the bands of 95 %."""
    lines = []
    for odometry in [*dict.fromkeys(row["odometry"] for row in rows), "all"]:
        some = [row for row in rows if odometry in ("all", row["odometry"])]
        lines.append(f"{odometry}: {len(some)} runs")
        for key, freedom in COLUMNS:
            values = [row[key] for row in some if row[key] is not None]
            if values:
                band = [chi2.ppf(p, freedom * len(values)) / len(values) for p in (0.025, 0.975)]
                lines.append(
                    f"  {key:20} {np.mean(values):5.2f}   band {band[0]:.2f} to {band[1]:.2f}"
                )
        closures = sum(row["closures"] for row in some)
        worst = max(some, key=lambda row: row["vertex_rmse_m"] or 0.0)
        lines += [
            f"  closures {closures}, wrong {sum(row['wrong'] for row in some)}, "
            f"vertices twice {sum(row['twice'] for row in some)}, "
            f"revisits recognised {_recognised(some)}",
            f"  vertex RMSE: mean {np.mean([r['vertex_rmse_m'] or 0.0 for r in some]):.3f}, "
            f"worst {worst['vertex_rmse_m']:.3f} m ({worst['name']}); "
            f"largest end error {max(row['end_error_m'] for row in some):.3f} m",
        ]
    return lines


def table(rows: list[Row]) -> list[str]:
    """A line in Markdown for the runs in each kind of world, with each laser and odometry.

    In brackets is the band of the mean NEES in which 95 % of such means would lie.
    """
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        world, _, odometry, laser = row["name"].split()
        groups.setdefault((world.partition(":")[0], laser, odometry), []).append(row)
    lines = [
        "| worlds | laser | odometry | runs | NEES pose (3) | vertices (2) | closures (3) "
        "| closed, wrong | twice | revisits recognised | vertex RMSE mean, worst, m "
        "| end error, worst, m |",
        "|---" * 12 + "|",
    ]
    for (family, laser, odometry), some in sorted(groups.items()):
        nees = [_mean_in_band(some, key, n) for key, n in COLUMNS if key != "filter_vertex_nees"]
        rmse = [row["vertex_rmse_m"] for row in some if row["vertex_rmse_m"] is not None]
        closed, wrong, twice = (sum(row[k] for row in some) for k in ("closures", "wrong", "twice"))
        end = max(row["end_error_m"] for row in some)
        lines.append(
            f"| `{family}` | {laser} | `{odometry}` | {len(some)} | {' | '.join(nees)} "
            f"| {closed}, {wrong} | {twice} | {_recognised(some)} "
            f"| {np.mean(rmse):.3f}, {max(rmse):.3f} | {end:.3f} |"
        )
    return lines


def _recognised(rows: list[Row]) -> str:
    """In how many revisits vertices were recognised; runs that did not count them are left out."""
    counted = [row for row in rows if "revisits" in row]
    if not counted:
        return "–"
    known, all_of = (sum(row[key] for row in counted) for key in ("recognised", "revisits"))
    return f"{known} of {all_of}"


def _mean_in_band(rows: list[Row], key: str, freedom: int) -> str:
    values = [row[key] for row in rows if row[key] is not None]
    if not values:
        return "–"
    low, high = (chi2.ppf(p, freedom * len(values)) / len(values) for p in (0.025, 0.975))
    return f"{np.mean(values):.2f} ({low:.1f} to {high:.1f})"


def plot(rows: list[Row], directory: Path) -> None:
    """NEES per run, error and sigma along the runs, vertices and NIS against chi-square."""
    import matplotlib as mpl  # noqa: PLC0415  # an extra

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415  # an extra

    figure, axes = plt.subplots(1, 4, figsize=(16, 3.8), layout="constrained")
    nees = sorted(row["pose_nees"] for row in rows)
    axes[0].plot(nees, np.arange(1, len(nees) + 1) / len(nees), label="pose, 3 degrees of freedom")
    of_vertices = sorted(row["vertex_nees"] for row in rows if row["vertex_nees"] is not None)
    shares = np.arange(1, len(of_vertices) + 1) / len(of_vertices)
    axes[0].plot(of_vertices, shares, label="vertices, 2")
    axes[0].set(xlabel="mean NEES of a run", ylabel="share of runs", xscale="log")
    share = np.linspace(0, 1, len(rows[0]["along"]))
    rms = np.sqrt(np.mean([np.square(row["along"]) for row in rows], axis=0))
    sigma = np.sqrt(np.mean([np.square(row["along_sigma"]) for row in rows], axis=0))
    axes[1].plot(share, rms, label="error, rms over runs")
    axes[1].plot(share, sigma, label="sigma that the filter gives")
    axes[1].set(xlabel="share of the run", ylabel="position of the robot, m")
    x = np.linspace(0, 8, 33)
    for axis, key, what in (
        (axes[2], "vertex_distances", "vertices of the map (NEES)"),
        (axes[3], "nis", "innovations of closures (NIS)"),
    ):
        axis.hist(np.concatenate([row[key] for row in rows]), x, density=True, label=what)
        axis.plot(x, chi2.pdf(x, 2), label="chi-square, 2")
        axis.set(xlabel="squared Mahalanobis distance", ylabel="density")
    for axis in axes:
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)  # hides no curve
    figure.savefig(directory / "consistency.png", dpi=110)
