"""Data association from look to look: what may be a vertex, and which ones are still in sight."""

import math
from collections.abc import Iterator

import numpy as np

from gvgbot.autonomy.gvg.local import LocalGvg, LocalNode
from gvgbot.autonomy.slam.graph import GvgGraph, Vertex
from gvgbot.autonomy.slam.recognition import RecognitionConfig, Sighting
from gvgbot.autonomy.views import Correspondence, View
from gvgbot.geometry import Array


def sightings_of(view: View, within_m: float) -> dict[int, Sighting]:
    """What may be vertices, not farther than that from the base, by nodes of the local GVG."""
    base = view.local_base.position
    return {
        key: _sighting(view.gvg, node)
        for key, node in view.gvg.nodes.items()
        if node.may_be_vertex and math.dist(node.position, base) < within_m
    }


def _sighting(gvg: LocalGvg, node: LocalNode) -> Sighting:
    branches = (
        node.branches if node.is_suspect else [b for b in node.branches if b not in node.weak]
    )
    bearings = [gvg.bearing(branch, node.clearance) for branch in branches]
    unclear = [gvg.bearing(branch, node.clearance) for branch in node.weak]
    if node.is_suspect and node.lead is not None:
        bearings.append(node.lead)
        unclear.append(node.lead)
    return Sighting(
        node.position,
        node.clearance,
        tuple(bearings),
        not node.is_endpoint,
        tuple(unclear),
        node.settled,
    )


def pair_tracked(
    graph: GvgGraph,
    view: View,
    sightings: dict[int, Sighting],
    known: Correspondence,
    config: RecognitionConfig,
) -> None:
    """Note which sightings, by node, are vertices seen moments ago: those at the same place.

    What was taken for a fork in a room may prove to be its end, and the other way round.
    """
    vertices, nodes = list(_tracked(graph, view, config)), list(sightings)
    gaps = _gaps(
        np.array([vertex.local.position for vertex in vertices]),
        np.array([sighting.position for sighting in sightings.values()]),
    )
    close = zip(*(gaps < config.same_place_m).nonzero(), strict=True)
    near = [(vertices[i], nodes[j], gaps[i, j]) for i, j in close]
    pairs = sorted(
        (sightings[node].kind != vertex.kind, float(metres), node, vertex.id)
        for vertex, node, metres in near
    )
    for changed, metres, node, vertex_id in pairs:
        reach = config.same_place_m * (0.5 if changed else 1.0)
        if metres < reach and node not in known.vertex_of and vertex_id not in known.node_of:
            known.pair(node, vertex_id)


def _gaps(some: Array, others: Array) -> Array:
    """Metres (N, M) from some points (N, 2) to others (M, 2), of which there may be none."""
    apart = some.reshape(-1, 1, 2) - others.reshape(-1, 2)
    gaps: Array = np.hypot(apart[..., 0], apart[..., 1])
    return gaps


def is_crowded(
    graph: GvgGraph,
    view: View,
    sighting: Sighting,
    known: Correspondence,
    config: RecognitionConfig,
) -> bool:
    """Whether a vertex of the kind of a sighting that is still tracked stands there already.

    Not if both are ends of edges, and seen at once: those may face each other in a gap.
    """
    return any(
        math.dist(vertex.local.position, sighting.position) < 0.5 * config.same_place_m
        for vertex in _tracked(graph, view, config)
        if vertex.kind == sighting.kind and (sighting.meetpoint or vertex.id not in known.node_of)
    )


def _tracked(graph: GvgGraph, view: View, config: RecognitionConfig) -> Iterator[Vertex]:
    """Vertices seen so lately that the local frame tells their place."""
    for vertex in graph.vertices.values():
        if view.travelled - vertex.seen_at < config.tracked_m:
            yield vertex
