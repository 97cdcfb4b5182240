"""What there is to be seen of the GVG from a keyframe, and what of that is doubtful."""

import numpy as np
from scipy.spatial import cKDTree

from gvgbot.autonomy.config import AutonomyConfig
from gvgbot.autonomy.gvg.local import LocalGvg
from gvgbot.autonomy.gvg.local_map import LocalMap
from gvgbot.autonomy.gvg.reduction import reduce_graph
from gvgbot.autonomy.gvg.voronoi import fine_graph
from gvgbot.autonomy.hazards import Hazards
from gvgbot.autonomy.mapping import Mapper
from gvgbot.autonomy.noisy_walls import NoisyWalls
from gvgbot.autonomy.traffic import Traffic
from gvgbot.autonomy.views import View, touching
from gvgbot.autonomy.virtual_walls import points_of
from gvgbot.geometry import Array, Pose
from gvgbot.hal.messages import Scan

_NOBODY = np.empty((0, 2))


class Sight:
    """Makes a view of the local map, and of what the laser does not see."""

    def __init__(
        self,
        config: AutonomyConfig,
        robot_radius: float,
        mapper: Mapper,
        hazards: Hazards,
        traffic: Traffic,
    ) -> None:
        self._reduction, self._half_width_m = config.reduction, config.local_map.half_width_m
        self._radius = robot_radius
        self._needed_m = robot_radius + config.passage_margin_m  # from its middle to walls
        self._noisy_walls = NoisyWalls(self._needed_m, config.local_map)
        self._mapper, self.hazards, self._traffic = mapper, hazards, traffic
        self.virtual_walls = points_of(config.virtual_walls)  # map frame
        self.open_clearance = config.reduction.open_clearance_m  # from walls; farther is no edge

    def note(self, scan: Scan, position: Array, local_map: LocalMap, travelled: float) -> None:
        """Account for a scan, taken at a position (2,), local frame, after so many metres."""
        self._noisy_walls.note(scan, position, local_map, travelled)
        self.hazards.forget(travelled)

    def view(
        self, scan: Scan, local_base: Pose, local_map: LocalMap, keyframe: int, travelled: float
    ) -> View:
        """What a scan shows that is in the local map; it is that of the keyframe of a number."""
        self.open_clearance = self._reduction.open_clearance(scan.range_max, self._half_width_m)
        self._mapper.heed(self.virtual_walls)
        virtual = self._mapper.map_in_local(local_base).transform(self.virtual_walls)
        self.hazards.virtual_walls = virtual[local_map.covers(virtual)]
        gvg, marks = self._mapper.marked(self._local_gvg(local_base, local_map), local_base)
        felt, newcomers = self.hazards.doubtful, self._traffic.newcomers
        may_go = np.concatenate([felt, local_map.suspects()])
        passing = newcomers.passing(scan.stamp)
        return View(
            keyframe,
            scan.stamp,
            travelled,
            local_base,
            gvg,
            local_map,
            doubtful=np.concatenate([may_go, self._traffic.standing]),
            doubted=self._doubted(gvg, may_go, local_map.tree()),
            marks=marks,
            is_somebody_found=newcomers.is_one_standing(scan.stamp, local_map),
            passing=passing,
            aside=passing if self._traffic.is_in_team else _NOBODY,
            may_be_robots=bool(self._traffic.strangers),
            field_of_view=scan.field_of_view,
            virtual_walls=self.hazards.virtual_walls,
            felt=felt,
            robot_radius=self._radius,
        )

    def _local_gvg(self, local_base: Pose, local_map: LocalMap) -> LocalGvg:
        """The GVG around the base, by what the local map shows and the map holds."""
        fine = fine_graph(
            self._noisy_walls.drawn(local_map),
            local_base.position,
            min_clearance=self._needed_m,
            roughness=self._reduction.roughness_m,
            open_clearance=self.open_clearance,
            felt=np.concatenate([self.hazards.points, self._traffic.in_the_way]),
            virtual_walls=self.hazards.virtual_walls,
        )
        known = self._mapper.known_around(local_base, self._half_width_m)
        return reduce_graph(fine, self._reduction, known).rings_cut_far_from(local_base.position)

    def _doubted(self, gvg: LocalGvg, may_go: Array, walls: cKDTree) -> frozenset[int]:
        """The nodes that may be there for a while only, because of obstacles (N, 2) or bodies.

        Of who is out of sight for long, so may be the end that he makes of a way; in a team, bodies
        lead the GVG nowhere, but hide how it goes on. Nobody does that from behind a wall.
        """
        newcomers = self._traffic.newcomers
        ends = frozenset(key for key, node in gvg.nodes.items() if node.degree == 1)
        by_bodies = touching(gvg, newcomers.points, walls)
        if self._traffic.is_in_team:
            by_bodies &= ends
        return touching(gvg, may_go) | by_bodies | (touching(gvg, newcomers.lost, walls) & ends)
