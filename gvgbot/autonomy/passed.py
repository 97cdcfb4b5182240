"""What may be people, or posts, and was out of sight before anybody knew: it never moved."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from gvgbot.autonomy.keyframes import Keyframe
from gvgbot.geometry import Array, Pose


@dataclass(frozen=True, slots=True, eq=False)
class Passed:
    """A disc in the local frame, and the number of the keyframe since which it is missed."""

    keyframe: int
    centre: Array
    radius: float

    def before(self, keyframe: int) -> Self:
        """The same if the keyframes after one are forgotten."""
        return replace(self, keyframe=min(self.keyframe, keyframe))

    def place(self, keyframes: Sequence[Keyframe], map_bases: Sequence[Pose]) -> Array:
        """The centre (2,), map frame, by where the keyframes are estimated to be."""
        number = min(self.keyframe, len(keyframes) - 1)
        local_base = keyframes[number].local_base
        return map_bases[number].transform(local_base.inverse().transform(self.centre))
