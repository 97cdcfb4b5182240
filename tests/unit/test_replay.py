"""A log of a drive around a ring of corridors, written from geometry, becomes a true map."""

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from gvgbot.cli import main
from gvgbot.geometry import Array, Pose
from gvgbot.maps.trajectory import decode_tum
from gvgbot.recording.config import RecordingConfig
from gvgbot.recording.recorder import Recorder

OUTER = np.array([(-2, -2), (14, -2), (14, 5), (16, 5), (16, 10), (-2, 10), (-2, -2)], float)
INNER = np.array([(1, 1), (11, 1), (11, 7), (6, 7), (6, 6.2), (1, 6.2), (1, 1)], float)
SEGMENTS = np.concatenate(
    [np.stack([line[:-1], line[1:]], axis=1) for line in (OUTER, INNER)]
)  # (N, 2, 2)
CORNERS = [(-0.5, -0.5), (12.5, -0.5), (12.5, 8.5), (-0.5, 8.5)]
STEP_M, LAPS = 0.5, 2


def ranges(pose: Pose) -> Array:
    """What 180 beams from -90 degrees on hit, by intersecting lines."""
    angles = pose.theta + np.radians(np.arange(180.0) - 90.0)
    d = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    a, e = SEGMENTS[None, :, 0], SEGMENTS[None, :, 1] - SEGMENTS[None, :, 0]
    w = a - pose.position
    cross = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (w[..., 0] * e[..., 1] - w[..., 1] * e[..., 0]) / cross
        u = (w[..., 0] * d[..., 1] - w[..., 1] * d[..., 0]) / cross
    hit = (t > 0) & (u >= 0) & (u <= 1)
    nearest: Array = np.where(hit, t, np.inf).min(axis=1)
    return nearest


def drive() -> list[Pose]:
    """The true way, some laps; turns on the spot at the corners."""
    way = []
    for k in range(4 * LAPS):
        (x0, y0), (x1, y1) = CORNERS[k % 4], CORNERS[(k + 1) % 4]
        heading = math.atan2(y1 - y0, x1 - x0)
        n = round(math.hypot(x1 - x0, y1 - y0) / STEP_M)
        way += [Pose(x0 + f * (x1 - x0), y0 + f * (y1 - y0), heading) for f in np.arange(n) / n]
        way += [Pose(x1, y1, heading + turn) for turn in (0.0, 0.4, 0.8, 1.2)]
    return way


def write_log(path: Path, way: list[Pose]) -> list[Pose]:
    """Odometry that turns too far and overrates distances; a scan for each pose."""
    odom, lines, heard = Pose(), [], []
    rng = np.random.default_rng(3)
    for k, pose in enumerate(way):
        if k:
            m = way[k - 1].to(pose)
            odom = odom.compose(
                Pose(1.03 * m.x, 1.03 * m.y, 1.01 * m.theta + 0.002 * math.hypot(m.x, m.y))
            )
        heard.append(odom)
        r = ranges(pose) + rng.normal(0.0, 0.01, 180)
        numbers = " ".join(f"{v:.2f}" for v in r)
        place = f"{odom.x:.6f} {odom.y:.6f} {odom.theta:.6f}"
        lines.append(f"ODOM {place} 0 0 0 {k:.3f} host {k:.3f}")
        lines.append(f"FLASER 180 {numbers} {place} {place} {k:.3f} host {k:.3f}")
    path.write_text("\n".join(lines), encoding="utf-8")
    return heard


def test_a_log_becomes_a_map_that_is_truer_than_its_odometry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    way = drive()
    odometry = write_log(tmp_path / "ring.log", way)
    with (tmp_path / "ring.log").open("a", encoding="utf-8") as log:
        log.write("\nFLASER 180 1.0 2.0\nODOM 0 0 0 0 0 0 1e9 host 0")
    assert main(["replay", str(tmp_path / "ring.log"), "--out", str(tmp_path / "run")]) == 0
    said = f"passed over: 2, the first in line {2 * len(way) + 1}\n"
    assert said in capsys.readouterr().out
    estimate = decode_tum((tmp_path / "run" / "estimate.tum").read_text(encoding="utf-8"))
    assert (np.diff(estimate.stamps) > 0.0).all()  # as evo and scipy's Slerp want it
    true = [way[0].to(pose) for pose in way]
    at = np.searchsorted(estimate.stamps, np.arange(len(way)) - 1e-4)
    error = np.hypot(*(estimate.positions[at] - [p.position for p in true]).T)
    drift = max(p.distance(q) for p, q in zip(odometry, true, strict=True))
    assert drift > 1.5
    assert error.max() < 0.15
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["outcome"], summary["reason"]) == ("stopped", "the log ends here")
    for name in ("map.geojson", "map.pgm", "map.png", "online.tum"):
        assert (tmp_path / "run" / name).stat().st_size > 0
    assert not (tmp_path / "run" / "truth.tum").exists()


@pytest.mark.parametrize("content", [b"", b"\0\1\2", None], ids=["empty", "binary", "missing"])
def test_a_bad_log_is_one_line_and_no_run(
    content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.log"
    if content is not None:
        path.write_bytes(content)
    assert main(["replay", str(path), "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert ("recording (MCAP)" in line) == (content is not None)  # the other kind there is
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("command", ["replay {} --out {}", "map export {} {} --ros-bag"])
def test_what_can_be_read_only_once_is_no_log(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A named pipe, and one as of `replay <(zcat log.gz)`."""
    os.mkfifo(tmp_path / "log")
    here, there = os.pipe()
    for path in (tmp_path / "log", Path(f"/dev/fd/{here}")):
        assert main(command.format(path, tmp_path / "out").split()) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"gvgbot: {path} is a pipe")
        assert "write what comes of it to a file first" in line
    os.close(here)
    os.close(there)
    assert not (tmp_path / "out").exists()


def test_a_replay_that_fails_leaves_what_was_there_before_and_nothing_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The map cannot be written: something is in the place of its picture."""
    write_log(tmp_path / "ring.log", drive()[:20])
    words = ["replay", str(tmp_path / "ring.log"), "--out", str(tmp_path / "run")]
    (tmp_path / "run" / "map.png" / "mine").mkdir(parents=True)
    for _ in range(2):
        assert main(words) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert "map.png" in line
        assert [path.name for path in (tmp_path / "run").iterdir()] == ["map.png"]
    (tmp_path / "run" / "map.png" / "mine").rmdir()
    (tmp_path / "run" / "map.png").rmdir()
    assert main(words) == 0


@pytest.mark.parametrize("text", ["robot: {name: [", "robot: {nmae: a}\nlaser: 7"])
def test_a_recording_whose_configuration_is_damaged_can_be_replayed_with_another(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(RecordingConfig(path=path), {"title": "ring", "config": text}):
        pass
    words = ["replay", str(path), "--out", str(tmp_path / "run")]
    assert main(words) == 2
    *mistakes, hint = capsys.readouterr().err.splitlines()
    assert mistakes
    assert all(f"the configuration in {path}" in line for line in mistakes)
    assert "--config" in hint
    assert not (tmp_path / "run").exists()
    assert main([*words, "--config", "sim.yaml"]) == 0


def test_who_sets_a_key_that_there_is_not_is_told_of_that_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(RecordingConfig(path=path), {"title": "ring", "config": "{}"}):
        pass
    assert main(["replay", str(path), "--set", "robot.nmae=frida"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "nmae" in line


def test_a_speed_is_for_what_is_served(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(tmp_path / "run.mcap"), "--speed", "5"]) == 2
    assert "--serve" in capsys.readouterr().err
