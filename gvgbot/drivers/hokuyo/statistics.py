"""What happened on the link to a laser."""

from dataclasses import dataclass


@dataclass(slots=True)
class LinkStatistics:
    """What happened on the link since the driver was made."""

    scans: int = 0
    missed_scans: int = 0  # gaps in the stamps of those that came
    bad_messages: int = 0  # damaged: dropped, the stream goes on
    stray_messages: int = 0  # whole, but not what was asked for
    repeated_scans: int = 0  # the same stamp again: the laser is frozen
    refused_scans: int = 0  # the laser said that it could not measure, and went on
    unanswered: int = 0  # commands without a reply in time
    fruitless: int = 0  # streams without a scan since the last one came
    restarts: int = 0  # of a stream that fell silent
    clock_resets: int = 0
    reboots: int = 0
