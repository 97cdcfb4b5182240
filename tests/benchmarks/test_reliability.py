"""The campaign: what it draws, what it finds when something is wrong, and that nothing is."""

from pathlib import Path

import pytest

from benchmarks.faults import FAULTS, LAYER, Fault, draw
from benchmarks.reliability import line, main, one, shortest, table
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
def test_the_first_seeds_do_no_harm_and_one_repeats_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--seeds", "2", "--jobs", "1", "--out", str(tmp_path)]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert main(arguments) == 0  # from what was kept
    assert capsys.readouterr().out == told
    again = one(1)
    assert line(again).rsplit(",", 1)[0] in told  # but for the time of computing
    assert "0 seeds failed" in next(iter(table([again])))
