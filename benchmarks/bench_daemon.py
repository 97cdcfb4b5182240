"""The daemon while it explores, and how fast it starts: `python -m benchmarks.bench_daemon`.

The devices are twins in another process, behind pseudo-terminals, so that what is measured is what
runs on a robot: drivers, autonomy, telemetry with nobody listening, and a mission on disk.
"""

import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from benchmarks.report import report, report_fact
from benchmarks.rigs.addresses import free_endpoint

LASERS = {"URG-04LX": 10.0, "UTM-30LX": 40.0}  # scans a second
TARGET_PERCENT = {10.0: 6.0, 40.0: 24.0}  # of a core; with four times the scans, four times that
MEASURED_S = 60.0
PATIENCE_S = 60.0
TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


def measure(laser: str, rate: float, folder: Path) -> None:
    """Explore the office in real time for a while, and take down what that costs."""
    links = {"laser": folder / "laser", "base": folder / "base"}
    told = ["--laser-link", str(links["laser"]), "--base-link", str(links["base"])]
    with gvgbot("twin", *told, "--set", f"twin.laser.model={laser}") as twins:
        assert twins.stdout is not None
        while "base:" not in (line := twins.stdout.readline()):
            assert line, "the twins did not start"
        settings = {
            "laser.port": links["laser"],
            "base.port": links["base"],
            "laser.rate_hz": rate,
            "telemetry.listen": f"[{free_endpoint()}]",
            "service.state_dir": folder / "state",
        }
        chosen = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        try:
            watch(["run", "turtlebot2.yaml", *chosen, "--out", str(folder / "run")], rate, folder)
        finally:
            twins.terminate()


def watch(command: list[str], rate: float, folder: Path) -> None:
    """Run the daemon; CPU and memory from when it is ready."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified:
        notified.bind(str(folder / "notify"))
        begin = perf_counter()
        with gvgbot(*command, NOTIFY_SOCKET=str(folder / "notify")) as daemon:
            while "READY=1" not in heard(notified):
                assert daemon.poll() is None, "the daemon ended"
            report(
                f"start at {rate:g} Hz: until it is ready", perf_counter() - begin, "s", at_most=2.0
            )
            report_fact(f"start at {rate:g} Hz: CPU of that", cpu(daemon.pid), "s")
            begin, used = perf_counter(), cpu(daemon.pid)
            while perf_counter() - begin < MEASURED_S:
                heard(notified)
            share = 100 * (cpu(daemon.pid) - used) / (perf_counter() - begin)
            report(
                f"daemon at {rate:g} Hz: CPU", share, "% of a core", at_most=TARGET_PERCENT[rate]
            )
            report_fact(f"daemon at {rate:g} Hz: memory", resident_mb(daemon.pid), "MB")
            daemon.send_signal(signal.SIGTERM)
            daemon.wait(PATIENCE_S)


def gvgbot(*arguments: str, **environment: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "gvgbot", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | environment,
    )


def heard(notified: socket.socket) -> str:
    """What the daemon tells its service manager next; empty after a second without a word."""
    ready, _, _ = select.select([notified], [], [], 1.0)
    return notified.recv(4096).decode() if ready else ""


def cpu(process: int) -> float:
    """Seconds of all threads of a process so far."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return TICK_S * (int(fields[11]) + int(fields[12]))


def resident_mb(process: int) -> float:
    for line in Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    raise LookupError(process)


def main() -> None:
    for laser, rate in LASERS.items():
        with tempfile.TemporaryDirectory() as folder:
            measure(laser, rate, Path(folder))


if __name__ == "__main__":
    main()
