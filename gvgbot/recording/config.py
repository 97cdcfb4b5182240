"""Where a run is recorded, and how much room that may take."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from gvgbot.ranges import Range


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingConfig:
    """An MCAP file with all that went into a run, so that it can be replayed."""

    path: Path | None = None  # such as run.mcap; what is there already stays. None: no recording
    file_mb: Annotated[float, Range(0.1, 100_000.0)] = 256.0  # then the next: run.1.mcap, ...
    total_mb: Annotated[float, Range(0.2, 10_000_000.0)] = 4096.0  # then the oldest file goes
    raw_bytes: bool = False  # also what goes over the links to laser and base

    def __post_init__(self) -> None:
        """Raises ValueError if there is no room for two files."""
        if self.total_mb < 2 * self.file_mb:
            raise ValueError(f"total_mb = {self.total_mb}: must be twice file_mb or more")
