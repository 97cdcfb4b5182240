"""What the robot does because somebody asked for it: stand, go on, drive somewhere, look around."""

from gvgbot.autonomy.errands.errands import Declined, Errands

__all__ = ["Declined", "Errands"]
