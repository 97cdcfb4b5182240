"""What all fuzz targets share: where they set out from, and how they run."""

import json
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import atheris

CHUNK = b"\xfe"  # a first byte that leaves seeds whole
DATA = Path(__file__).parents[1] / "data"


def vectors(name: str) -> list[dict[str, Any]]:
    """The examples of a protocol."""
    found: list[dict[str, Any]] = json.loads((DATA / name).read_text("ascii"))["vectors"]
    return found


def chunks(data: bytes) -> Iterable[bytes]:
    """What follows the first byte, cut into pieces as long as that says."""
    size = 1 + (data[0] if data else 0)
    return (data[start : start + size] for start in range(1, len(data), size))


def fuzz(one_input: Callable[[bytes], None], seeds: Iterable[bytes]) -> None:
    """Run libFuzzer, with its own arguments, from these seeds; it ends the process itself."""
    with tempfile.TemporaryDirectory() as folder:
        for number, seed in enumerate(seeds):
            (Path(folder) / str(number)).write_bytes(CHUNK + seed)
        atheris.Setup([*sys.argv, folder], one_input)
        atheris.Fuzz()
