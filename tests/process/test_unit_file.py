"""The service manager understands the unit that comes with the robot."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

UNIT = Path(__file__).parents[2] / "systemd" / "gvgbot.service"
ANALYZE = shutil.which("systemd-analyze")

pytestmark = pytest.mark.skipif(ANALYZE is None, reason="there is no systemd-analyze here")


def test_the_unit_has_neither_mistakes_nor_unknown_keys(tmp_path: Path) -> None:
    python = Path(sys.executable).parent
    unit = tmp_path / UNIT.name
    unit.write_text(UNIT.read_text().replace("/opt/gvgbot/bin", str(python)))
    done = subprocess.run(
        [str(ANALYZE), "verify", str(unit)], check=False, capture_output=True, text=True, timeout=20
    )
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
