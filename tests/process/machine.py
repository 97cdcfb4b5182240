"""A systemd of its own, in namespaces of its own, on top of this machine's files."""

import contextlib
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

BOOT_S, LIFE_S = 15.0, 240
NEEDED = ("unshare", "nsenter", "chroot", "pivot_root", "mount", "mknod", "timeout")
SYSTEMD = Path("/lib/systemd/systemd")
SOURCE = Path(__file__).parents[2]
# Its root is pivoted to: in a mere chroot no service could have users of its own.
# All that it writes goes to a tmpfs that ends with it, and it ends with the one who began it.
UNSHARE = (
    "unshare --mount --pid --fork --uts --ipc --net --cgroup --propagation private --kill-child"
)
BOOT = """
set -e
mount -t tmpfs tmpfs "$1"
mkdir "$1/upper" "$1/work" "$1/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$1/upper,workdir=$1/work" "$1/root"
cd "$1/root"
mount -t proc proc proc
mount -t sysfs -o ro sysfs sys
mount -t cgroup2 cgroup2 sys/fs/cgroup
mkdir -p opt/gvgbot/bin opt/python opt/site opt/source
mount --bind "$2" opt/python
mount --bind "$3" opt/site
mount --bind "$4" opt/source
for folder in run tmp dev; do mount -t tmpfs tmpfs "$folder"; done
mknod -m 666 dev/null c 1 3
mknod -m 666 dev/zero c 1 5
mknod -m 666 dev/full c 1 7
mknod -m 666 dev/random c 1 8
mknod -m 666 dev/urandom c 1 9
for program in python gvgbot; do
    printf '#!/bin/sh\\nexport PYTHONPATH=/opt/source:/opt/site\\n' > "opt/gvgbot/bin/$program"
    printf 'LD_LIBRARY_PATH=/opt/python/lib exec /opt/python/bin/python3 ' \
        >> "opt/gvgbot/bin/$program"
    chmod 755 "opt/gvgbot/bin/$program"
done
echo '"$@"' >> opt/gvgbot/bin/python
echo '-m gvgbot "$@"' >> opt/gvgbot/bin/gvgbot
printf '[Unit]\\nDescription=Nothing but what a test starts\\n' > etc/systemd/system/test.target
mkdir old
pivot_root . old
exec chroot . sh -c 'umount -l /old && exec /lib/systemd/systemd --system --unit=test.target'
"""


class NoMachine(Exception):
    """Why there is none here."""


@dataclass(frozen=True)
class Machine:
    """A booted machine, by the process that is its first."""

    pid: int

    def run(self, *command: str) -> str:
        """What a command in it says. Raises CalledProcessError."""
        return self.attempt(*command, check=True).stdout

    def attempt(self, *command: str, check: bool = False) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            ["nsenter", "-t", str(self.pid), "-a", "-r", "-w", *command],
            check=check,
            capture_output=True,
            text=True,
            timeout=60,
        )

    def write(self, path: Path, content: str) -> None:
        inside = Path(f"/proc/{self.pid}/root") / path.relative_to("/")
        inside.parent.mkdir(parents=True, exist_ok=True)
        inside.write_text(content)

    def read(self, path: str) -> str:
        return (Path(f"/proc/{self.pid}/root") / path.lstrip("/")).read_text()

    def property(self, name: str) -> str:
        return self.run("systemctl", "show", "gvgbot", "--value", "-p", name).strip()


@contextlib.contextmanager
def machine(folder: Path) -> Iterator[Machine]:
    """A machine that is up. Raises NoMachine."""
    missing = [name for name in NEEDED if shutil.which(name) is None]
    if os.geteuid() != 0 or missing or not SYSTEMD.exists():
        raise NoMachine("it takes root, systemd and " + ", ".join(missing or NEEDED))
    command = [
        *("timeout", "-k", "2", str(LIFE_S), *UNSHARE.split(), "sh", "-c", BOOT, "sh"),
        *map(str, (folder, sys.base_prefix, sysconfig.get_path("purelib"), SOURCE)),
    ]
    log = folder.parent / "boot.log"
    with (
        log.open("w") as output,
        subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True) as process,
    ):
        try:
            yield _booted(process, log)
        finally:
            process.terminate()


def _booted(process: "subprocess.Popen[bytes]", log: Path) -> Machine:
    deadline = time.perf_counter() + BOOT_S
    while time.perf_counter() < deadline and process.poll() is None:
        found = _first_process(process.pid)
        if found is not None and (
            found.attempt("systemctl", "is-system-running").stdout.strip() == "running"
        ):
            return found
        time.sleep(0.1)  # noqa: TID251  # another program is waited for
    raise NoMachine(f"systemd does not boot here: {log.read_text().strip()[-300:]}")


def _first_process(pid: int) -> Machine | None:
    """The systemd below a process, each of whose descendants down to it has one child."""
    with contextlib.suppress(OSError, IndexError):
        while Path(f"/proc/{pid}/comm").read_text().strip() != "systemd":
            pid = int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])
        return Machine(pid)
    return None
