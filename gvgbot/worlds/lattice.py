"""Which neighbours on a square lattice are joined, drawn at random."""

from collections.abc import Iterator

import numpy as np

Link = tuple[int, int]


def lattice_links(side: int, loops: int, rng: np.random.Generator) -> list[Link]:
    """Pairs of neighbouring nodes: a random tree over all of them, and some more for loops.

    Nodes are numbered row by row, `side` to a row.
    """
    pairs = [*_neighbours(side)]
    group = list(range(side**2))
    tree: list[Link] = []
    spare: list[Link] = []
    for a, b in (pairs[i] for i in rng.permutation(len(pairs))):
        if group[a] == group[b]:
            spare.append((a, b))
            continue
        group = [group[a] if g == group[b] else g for g in group]
        tree.append((a, b))
    return tree + spare[:loops]


def _neighbours(side: int) -> Iterator[Link]:
    for k in range(side**2):
        if (k + 1) % side:
            yield k, k + 1
        if k + side < side**2:
            yield k, k + side
