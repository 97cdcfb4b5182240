"""What recording costs the control loop: `python -m benchmarks.bench_recording`.

A UTM-30LX at 40 Hz and a base at 50 Hz, with ranges to the millimetre, as drivers give them.
"""

import tempfile
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from benchmarks.report import report
from gvgbot.autonomy.control.reflexes import Felt
from gvgbot.autonomy.loop import Cycle
from gvgbot.geometry import Array, Pose, Twist
from gvgbot.hal.messages import Contact, Odometry, Scan
from gvgbot.recording.config import RecordingConfig
from gvgbot.recording.recorder import Recorder

SECONDS = 60
SCAN_HZ, CYCLE_HZ = 40, 50
SPEED = Twist(0.5, 0.1)


def scans() -> list[Scan]:
    """A wall that comes nearer, with a centimetre of noise."""
    rng, bearings = np.random.default_rng(1), np.linspace(-2.35, 2.35, 1081)
    wall = 3.0 + np.abs(np.sin(3 * bearings))
    noisy = [wall - 0.001 * k + rng.normal(0.0, 0.01, 1081) for k in range(SECONDS * SCAN_HZ)]
    return [
        Scan(k / SCAN_HZ, np.round(r, 3), -2.35, 4.7 / 1080, 0.1, 30.0) for k, r in enumerate(noisy)
    ]


def cycles() -> list[Cycle]:
    return [
        Cycle(
            Odometry(k / CYCLE_HZ, Pose(0.01 * k, 1e-5 * k * k, 1e-3 * k), SPEED),
            Felt(Contact(k / CYCLE_HZ)),
            SPEED,
            SPEED,
        )
        for k in range(SECONDS * CYCLE_HZ)
    ]


def timed(calls: list[partial[None]]) -> Array:
    """Milliseconds of each call."""
    times = []
    for call in calls:
        start = perf_counter()
        call()
        times.append(1e3 * (perf_counter() - start))
    return np.array(times)


def main() -> None:
    with tempfile.TemporaryDirectory() as directory:
        config = RecordingConfig(path=Path(directory) / "run.mcap")
        with Recorder(config, {}, patient=True) as to:
            calls = [(s.stamp, partial(to.on_scan, s)) for s in scans()]
            calls += [(c.odometry.stamp, partial(to.on_cycle, c, None)) for c in cycles()]
            start = process_time()
            times = timed([call for _, call in sorted(calls, key=lambda one: one[0])])
        share = (process_time() - start) / SECONDS
        size = sum(path.stat().st_size for path in Path(directory).iterdir())
    report("a message in the loop, median", float(np.median(times)), "ms", at_most=0.2)
    report(
        "a message in the loop, 99 % of them", float(np.quantile(times, 0.99)), "ms", at_most=2.0
    )
    report("CPU while recording, both threads", 100 * share, "%", at_most=5.0)
    report("file, an hour of it", size / SECONDS * 3600 / 1e6, "MB", at_most=1000.0)


if __name__ == "__main__":
    main()
