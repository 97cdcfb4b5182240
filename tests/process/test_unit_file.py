"""The service manager understands the units that come with the robot, and finds little exposed."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gvgbot.installation import user_files
from gvgbot.strict_yaml import packaged

UNITS = Path(__file__).parents[2] / "systemd"
ANALYZE = shutil.which("systemd-analyze")
EXPOSURE = 1.5  # of 10

pytestmark = pytest.mark.skipif(ANALYZE is None, reason="there is no systemd-analyze here")


def analyze(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [str(ANALYZE), *arguments]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=20)


@pytest.mark.parametrize("name", ["gvgbot.service", "gvgbot-user.service"])
def test_the_units_have_neither_mistakes_nor_unknown_keys(tmp_path: Path, name: str) -> None:
    python = Path(sys.executable).parent
    unit = tmp_path / name
    unit.write_text((UNITS / name).read_text().replace("/opt/gvgbot/bin", str(python)))
    done = analyze("verify", str(unit))
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_a_unit_in_a_folder_with_a_blank_has_no_mistakes(tmp_path: Path) -> None:
    programs = tmp_path / "my 100% robot"
    programs.mkdir()
    for name in ("gvgbot", "python"):
        (programs / name).symlink_to(sys.executable)
    written = user_files(packaged("turtlebot2.yaml"), programs, programs, None)[1]
    unit = tmp_path / written.path.name
    unit.write_text(written.content)
    done = analyze("verify", str(unit))
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_little_of_the_machine_is_exposed_to_the_service() -> None:
    unit = str(UNITS / "gvgbot.service")
    done = analyze("security", "--offline=true", f"--threshold={round(10 * EXPOSURE)}", unit)
    if "unrecognized option" in done.stderr:
        pytest.skip("this systemd-analyze cannot judge a file")
    assert done.returncode == 0, done.stdout[-200:]
    told = re.search(r"exposure level for gvgbot\.service: (\d+\.\d)", done.stdout)
    assert told is not None
    assert float(told[1]) <= EXPOSURE
    bare = UNITS / "gvgbot-user.service"  # without a sandbox: the judge can tell
    assert analyze("security", "--offline=true", "--threshold=50", str(bare)).returncode != 0


def test_the_user_is_one_that_sysusers_can_make(tmp_path: Path) -> None:
    sysusers = shutil.which("systemd-sysusers")
    if sysusers is None:
        pytest.skip("there is no systemd-sysusers here")
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc/group").write_text("dialout:x:20:\n")
    command = [sysusers, f"--root={tmp_path}", str((UNITS / "sysusers.conf").resolve())]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=20)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "etc/passwd").read_text().startswith("gvgbot:x:")
    groups = dict(line.split(":", 1) for line in (tmp_path / "etc/group").read_text().split())
    assert groups["dialout"].endswith(":gvgbot")
