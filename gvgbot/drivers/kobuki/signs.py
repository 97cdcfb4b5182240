"""What the lamps and tunes of the base say to people beside it."""

from gvgbot.drivers.kobuki.commands import NO_OUTPUT, Melody, Output
from gvgbot.hal.messages import Sign

_ORANGE1 = Output.LED1_RED | Output.LED1_GREEN
_ORANGE2 = Output.LED2_RED | Output.LED2_GREEN

LAMPS = _ORANGE1 | _ORANGE2
SIGNS: dict[Sign, tuple[Output, Melody | None]] = {
    "off": (NO_OUTPUT, None),
    "starting": (_ORANGE1 | _ORANGE2, None),
    "busy": (Output.LED1_GREEN, None),
    "searching": (Output.LED1_GREEN | _ORANGE2, None),
    "standing": (_ORANGE1, None),
    "finished": (Output.LED1_GREEN | Output.LED2_GREEN, Melody.CLEANING_END),
    "trouble": (Output.LED1_RED, Melody.ERROR),
}
