"""What is published can be built, installed and used, without the project beside it."""

import re
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a source distribution, and of the wheel that was built from it."""
    out = tmp_path_factory.mktemp("dist")
    said_by(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT))
    return out


@pytest.fixture(scope="module")
def programs(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a new environment that has the wheel, and borrows its dependencies."""
    home = tmp_path_factory.mktemp("venv")
    venv.create(home, with_pip=False)
    python, (wheel,) = home / "bin" / "python", built.glob("*.whl")
    said_by(
        sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", str(wheel)
    )
    (site,) = home.glob("lib/*/site-packages")
    borrowed = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site / "borrowed.pth").write_text("\n".join(borrowed), encoding="utf-8")
    return home / "bin"


def said_by(*command: str, where: Path = Path("/"), status: int = 0) -> str:
    done = subprocess.run(command, capture_output=True, check=False, cwd=where, text=True)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


def test_the_wheel_has_all_of_the_package_and_nothing_else(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    tracked = said_by("git", "ls-files", "gvgbot", where=ROOT).splitlines()
    assert {"gvgbot/py.typed", "gvgbot/configs/sim.yaml"} <= inside
    assert set(tracked) - inside == set()
    assert {name.split("/")[0] for name in inside} == {"gvgbot"}


def test_the_source_distribution_has_what_its_readers_need(built: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as tar:
        names = {name.partition("/")[2] for name in tar.getnames()}
    wanted = "README.md CHANGELOG.md LICENSE CONTRIBUTING.md SECURITY.md CITATION.cff mkdocs.yml"
    assert set(wanted.split()) - names == set()
    assert "tests/process/test_package.py" in names
    assert not [name for name in names if name.startswith(("runs/", "site/", ".venv/"))]


def test_an_installed_copy_explores(programs: Path, tmp_path: Path) -> None:
    place = said_by(str(programs / "python"), "-c", "import gvgbot; print(gvgbot.__file__)")
    assert place.startswith(str(programs.parent))
    short = ("explore", "--world", "ring", "--set", "twin.time_limit_s=3")
    said_by(str(programs / "gvgbot"), *short, where=tmp_path, status=1)  # no time to finish
    assert (tmp_path / "runs" / "ring-1" / "map.geojson").exists()


def test_an_installed_copy_knows_its_version(programs: Path, built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    version = re.findall(r"gvgbot-(.*?)-py3", wheel.name)[0]
    assert said_by(str(programs / "gvgbot"), "--version").split() == ["gvgbot", version]
