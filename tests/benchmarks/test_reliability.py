"""The campaign: what it draws, what it finds when something is wrong, and that nothing is."""

import json
import math
from pathlib import Path

import pytest

from benchmarks import trial
from benchmarks.faults import FAULTS, LAYER, Fault, draw
from benchmarks.reliability import ORACLES, RESULTS, by_oracle, line, main, one, shortest
from benchmarks.sabotage import SABOTAGES, Sabotage
from benchmarks.trial import once

ROOT = Path(__file__).parents[2]


def test_a_seed_draws_one_schedule_and_many_seeds_draw_every_fault() -> None:
    assert draw(7) == draw(7) != draw(8)
    drawn = {fault.name for seed in range(300) for fault in draw(seed)}
    assert drawn == set(LAYER)
    assert set(FAULTS) == {
        *("link", "device", "sensing", "world", "process", "disk", "network", "requests")
    }


def test_the_shortest_schedule_has_all_that_it_takes_and_no_more() -> None:
    faults = [Fault(float(i), name, 1.0) for i, name in enumerate(LAYER)]
    needed = [faults[3], faults[9], faults[17]]
    assert shortest(faults, lambda fewer: set(needed) <= set(fewer)) == needed


@pytest.mark.parametrize("sabotage", SABOTAGES, ids=lambda sabotage: sabotage.what)
def test_what_is_broken_on_purpose_is_still_there_to_be_broken(sabotage: Sabotage) -> None:
    text = (ROOT / "gvgbot" / sabotage.module).read_text(encoding="utf-8")
    compile(sabotage.broken(text), sabotage.module, "exec")


def test_the_table_names_the_seeds_that_hurt_an_oracle() -> None:
    rows = [{"seed": seed, "violations": {"false vertex": "far"}} for seed in range(3, 15)]
    rows.append({"seed": 2, "violations": {}})
    table = dict(row[2:-2].split(" | ") for row in list(by_oracle(rows))[2:])
    assert table.pop(ORACLES["false vertex"]) == "12: 3, 4, 5, 6, 7, 8, 9, 10, 11, 12"
    assert set(table.values()) == {"0"}


def test_a_log_is_of_one_seed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--seeds", "3", "--log"])
    assert ended.value.code == 2
    assert "--log needs --seed" in capsys.readouterr().err


@pytest.mark.slow
def test_a_base_that_drives_on_when_nobody_commands_it_any_more_is_found_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(trial, "END_S", 10.0)
    killed = [Fault(6.0, "kill", 4.0)]
    assert not once(1, killed).violations
    wild = once(1, killed, ["twin.base.has_command_timeout=false"])
    assert {"does not stop", "contact at speed"} & wild.violations.keys()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_seed_repeats_itself_and_what_was_kept_is_not_run_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial, "END_S", 7.0)
    arguments = ["--seed", "244", "--log", "--out", str(tmp_path)]
    assert main(arguments) == 0
    kept = (tmp_path / RESULTS).read_text(encoding="utf-8")
    printed, (first, again) = capsys.readouterr().out, (json.loads(kept), one(244))
    assert line(again).rsplit(",", 1)[0] in printed  # but for computing time
    assert " s: guard stopped reason='no scan'" in printed  # its laser freezes
    for row in (first, again):
        del row["cpu_s"], row["kept"]
    assert first == again
    assert first["driven_m"] > 0.0
    (tmp_path / RESULTS).write_text(kept.replace('"seed": 244', '"seed": 1'), encoding="utf-8")
    assert main(["--seeds", "1", "--out", str(tmp_path)]) == 0
    assert "1 seeds, 4 faults" in capsys.readouterr().out


@pytest.mark.slow
def test_what_a_full_disk_did_not_keep_hurts_no_oracle_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The place is judged ten seconds after the robot was started again, at 29 s."""
    monkeypatch.setattr(trial, "END_S", 42.0)
    assert once(416, draw(416)).violations == {}


@pytest.mark.slow
def test_faults_of_every_kind_hurt_no_oracle(monkeypatch: pytest.MonkeyPatch) -> None:
    """A layer of FAULTS each, and each way in which they are done to the robot."""
    monkeypatch.setattr(trial, "END_S", 22.0)
    faults = [
        Fault(0.0, "person", math.inf),
        Fault(2.0, "laser noise", 1.5),
        Fault(2.5, "nobody listens", 1.0),
        Fault(4.0, "driven carelessly", 4.0),
        Fault(5.0, "disk full", 2.0),
        Fault(8.5, "garbage", 1.0),
        Fault(10.0, "laser silence", 2.6),
        Fault(12.6, "base cliff", 0.8),
        Fault(13.5, "kill, journal bit", 2.0),
        Fault(15.5, "base low battery", 1.0),
        Fault(16.0, "carried", 2.0),
        Fault(18.5, "set", 0.0),
        Fault(19.0, "pause", 3.0),
    ]
    assert {LAYER[fault.name] for fault in faults} == set(FAULTS)
    tried = once(1, faults)
    assert (tried.violations, tried.lives) == ({}, 2)
