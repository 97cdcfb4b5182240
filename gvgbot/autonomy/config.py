"""How each part of autonomy is configured."""

from dataclasses import dataclass, field
from typing import Annotated

from gvgbot.autonomy.control.edge_follower import EdgeFollowerConfig
from gvgbot.autonomy.control.reflexes import ReflexConfig
from gvgbot.autonomy.evidence import MappingConfig
from gvgbot.autonomy.gvg.local_map import LocalMapConfig
from gvgbot.autonomy.gvg.reduction import ReductionConfig
from gvgbot.autonomy.hazards import HazardConfig
from gvgbot.autonomy.keyframes import KeyframeConfig
from gvgbot.autonomy.newcomers import NewcomersConfig
from gvgbot.autonomy.slam.ekf import OdometryNoise
from gvgbot.autonomy.slam.recognition import RecognitionConfig
from gvgbot.autonomy.slam.scan_matching import ScanMatchingConfig
from gvgbot.autonomy.virtual_walls import VirtualWall, checked
from gvgbot.ranges import Range


@dataclass(frozen=True, slots=True, kw_only=True)
class AutonomyConfig:
    """All parts of autonomy, by their module's name."""

    keyframe: KeyframeConfig = field(default_factory=KeyframeConfig)
    local_map: LocalMapConfig = field(default_factory=lambda: LocalMapConfig(half_width_m=10.0))
    far_map: LocalMapConfig = field(
        default_factory=lambda: LocalMapConfig(half_width_m=20.0, cell_m=0.25, bridge_gap_m=0.0)
    )  # only matched with: the end of a long corridor is what tells how far one has come
    reduction: ReductionConfig = field(default_factory=ReductionConfig)
    edge_follower: EdgeFollowerConfig = field(default_factory=EdgeFollowerConfig)
    reflexes: ReflexConfig = field(default_factory=ReflexConfig)
    hazards: HazardConfig = field(default_factory=HazardConfig)
    newcomers: NewcomersConfig = field(default_factory=NewcomersConfig)
    mapping: MappingConfig = field(default_factory=MappingConfig)
    recognition: RecognitionConfig = field(default_factory=RecognitionConfig)
    scan_matching: ScanMatchingConfig = field(default_factory=ScanMatchingConfig)
    odometry_noise: OdometryNoise = field(default_factory=OdometryNoise)
    passage_margin_m: Annotated[float, Range(0.0, 0.5)] = 0.05  # beyond the radius, on each side
    # lines that it does not cross, as if there were walls, from corner to corner: m, map frame
    virtual_walls: tuple[VirtualWall, ...] = ()

    def __post_init__(self) -> None:
        """Raises ValueError for a virtual wall that is no line."""
        checked(self.virtual_walls)
