"""Being at a place on the map, whatever the way there, and finding that near by."""

from collections.abc import Mapping, Sequence

import numpy as np

from gvgbot.autonomy.destinations import foot_of
from gvgbot.autonomy.events import Recovery
from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.autonomy.knowledge import ON_EDGE_M
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.mission import Mission
from gvgbot.autonomy.near_by import misplaced, walls_known, walls_seen
from gvgbot.autonomy.slam import ekf
from gvgbot.autonomy.slam.ekf import Belief
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.views import View
from gvgbot.autonomy.whereabouts import Whereabouts
from gvgbot.geometry import Pose

LATELY_M = 25.0  # driven: since then a robot may have been elsewhere than it believed
_UNCLEAR = np.diag([0.5**2, 0.5**2, 0.1**2])  # more covariance, of who is elsewhere near by
_FOUND = np.diag([0.1**2, 0.1**2, 0.03**2])  # covariance of a place found on the map


def place(
    mission: Mission, mapper: Mapper, vertices: Mapping[int, Pose], map_base: Pose, seen_at: float
) -> None:
    """Believe to be at a pose on a map of vertices (map_vertex).

    The belief may have the map elsewhere, and is unsure of that, but not of what is near there.
    All vertices are known from afar, see `Mapper.lose_sight`.
    """
    if vertices:
        nearest = min(vertices, key=lambda vertex: vertices[vertex].distance(map_base))
        seen = vertices[nearest].to(map_base)
        mapper.belief = ekf.place_robot(mapper.belief, nearest, seen, _FOUND)
    else:
        mapper.belief = Belief(np.array([map_base.x, map_base.y, map_base.theta]), _FOUND.copy())
    mapper.lose_sight(seen_at)
    mission.where, mission.target = Whereabouts(), None
    mission.reason = ""


def be_on_edge(mission: Mission, mapper: Mapper, local_base: Pose) -> None:
    """Be on the known edge that passes here, if one does: its ends may be out of sight."""
    belief = mapper.belief
    foot = foot_of(mapper, belief.map_base.position)
    if foot is None or foot.away > ON_EDGE_M:
        return
    end, come = foot.edge.a, foot.edge.polyline[: foot.index + 1]
    local_vertex = mapper.map_in_local(local_base).compose(belief.map_vertex(end.vertex))
    mission.where.rejoin(end, local_vertex.transform(come))


def search_near_by(
    mission: Mission,
    mapper: Mapper,
    view: View,
    seen: Sequence[Keyframe],
    old: Sequence[Keyframe],
    matching: ScanMatchingConfig,
    seen_at: float,
) -> Recovery | None:
    """Be where walls `seen` from keyframes show it to be, if that is clearly elsewhere.

    If it is elsewhere, but not clear where, be unsure of that. The walls of the map are those of
    `old` keyframes, and of vertices. What vertices have come lately, since `seen_at`, were drawn
    where the robot was not.
    """
    map_base, walls = mapper.belief.map_base, walls_seen(seen, view.local_base)
    found = misplaced(walls, walls_known(mapper, old), map_base, matching)
    if found is None:
        return None
    if not found.is_clear:
        mapper.move(Pose(), _UNCLEAR)
        mapper.lose_sight(seen_at)
        reason = "the walls around fit better in more than one place near by"
        return Recovery(view.stamp, "doubt its place until it knows a vertex again", reason)
    known = mapper.graph.vertices
    is_map = any(vertex.established for vertex in known.values())
    for vertex in [v for v in known.values() if is_map and not v.established]:
        if vertex.seen_at > seen_at:
            mapper.remove(view, vertex, "it was drawn at a wrong place")
    belief = mapper.belief
    vertices = {vertex: belief.map_vertex(vertex) for vertex in belief.ids}
    place(mission, mapper, vertices, found.map_base, seen_at)
    be_on_edge(mission, mapper, view.local_base)
    metres = map_base.distance(found.map_base)
    reason = f"it was {metres:.2f} m off, {found.share:.0%} of the walls around say"
    return Recovery(view.stamp, "go on from its place on the map", reason)
