"""The campaign: what it draws, what it finds when something is wrong, and that nothing is."""

from pathlib import Path

import pytest

from benchmarks.faults import FAULTS, LAYER, Fault, draw
from benchmarks.reliability import RESULTS, line, main, one, shortest
from benchmarks.trial import trial


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


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_base_that_drives_on_when_nobody_commands_it_any_more_is_found_out() -> None:
    killed = [Fault(6.0, "kill", 6.0)]
    assert not trial(1, killed).violations
    wild = trial(1, killed, ["twin.base.has_command_timeout=false"])
    assert {"does not stop", "contact at speed"} & wild.violations.keys()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_seed_repeats_itself_and_what_was_kept_is_not_run_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--seed", "10", "--out", str(tmp_path)]
    assert main(arguments) == 0
    kept = (tmp_path / RESULTS).read_text(encoding="utf-8")
    assert line(one(10)).rsplit(",", 1)[0] in capsys.readouterr().out  # but for computing time
    (tmp_path / RESULTS).write_text(kept.replace('"seed": 10', '"seed": 1'), encoding="utf-8")
    assert main(["--seeds", "1", "--out", str(tmp_path)]) == 0
    assert "1 seeds, 3 faults" in capsys.readouterr().out
