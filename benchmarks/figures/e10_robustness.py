"""E10: degenerate situations, each a scenario with a condition that is tested."""

import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

from benchmarks.figures.findings import Finding

ROOT = Path(__file__).parents[2]
SHAPES, PEOPLE = "tests/scenarios/test_shapes.py", "tests/scenarios/test_people.py"
CONTACTS, STARTS = "tests/scenarios/test_contacts.py", "tests/scenarios/test_starts_and_slips.py"
GLASS, FILES = (
    "tests/scenarios/test_glass_and_furniture.py",
    "tests/unit/persistence/test_mission_files.py",
)
SCENARIOS = {  # the situation, and the tests of it
    "No wall within reach": (
        f"{SHAPES}::test_a_field_without_a_wall_in_sight_ends_the_run_with_a_reason",
        f"{SHAPES}::test_a_hall_whose_walls_are_out_of_sight_at_first_is_left_by_its_corridor",
    ),
    "Meetpoints that almost coincide; four ways": (
        f"{SHAPES}::test_a_crossing_is_one_meetpoint_of_four",
    ),
    "Alcoves": (f"{SHAPES}::test_alcoves_less_deep_than_the_corridor_is_wide_are_no_vertices",),
    "A loop at one vertex": (
        f"{SHAPES}::test_a_pillar_in_a_dead_end_makes_an_edge_from_a_vertex_to_itself",
    ),
    "A ring without a vertex": (f"{SHAPES}::test_a_ring_without_a_vertex_is_driven_round_once",),
    "Parallel edges": (
        f"{SHAPES}::test_two_ways_round_a_block_are_two_edges_between_the_same_vertices",
    ),
    "What lies behind the laser's view": (
        f"{SHAPES}::test_a_side_corridor_that_lies_behind_the_laser_s_view_is_found",
    ),
    "Glass": (
        f"{GLASS}::test_a_room_behind_glass_is_entered_by_its_door",
        f"{CONTACTS}::test_a_pane_of_glass_across_a_corridor_ends_it_after_a_few_touches",
    ),
    "Mixed pixels": (f"{GLASS}::test_mixed_pixels_are_no_posts",),
    "Legs of chairs and tables": (
        f"{GLASS}::test_the_legs_of_a_chair_are_led_round_without_hesitation",
        f"{GLASS}::test_a_robot_between_two_legs_leaves_without_hesitation",
    ),
    "People": (
        f"{PEOPLE}::test_a_person_who_steps_aside_soon_is_waited_for",
        f"{PEOPLE}::test_a_person_who_jumps_into_the_way_is_not_touched",
    ),
    "Doors too narrow, and just wide enough": (
        f"{SHAPES}::test_a_door_that_the_robot_does_not_fit_through_is_no_edge",
        f"{SHAPES}::test_a_door_that_the_robot_fits_through_is_an_edge",
    ),
    "Dead ends, wide and narrow": (f"{SHAPES}::test_a_dead_end_is_half_its_width_before_the_wall",),
    "Corners": (f"{SHAPES}::test_a_bend_round_a_corner_is_no_vertex",),
    "Slipping wheels": (f"{STARTS}::test_wheels_that_spin_for_a_while_leave_the_map_where_it_is",),
    "Bumper, cliff, lifted wheels": (
        f"{CONTACTS}::test_a_contact_makes_the_robot_back_off_once_and_go_on",
        f"{CONTACTS}::test_a_place_where_there_is_no_floor_is_never_driven_over",
        f"{CONTACTS}::test_a_robot_that_is_lifted_stands_until_its_wheels_are_down_again",
    ),
    "Places that look alike": (f"{SHAPES}::test_equal_branches_are_not_taken_for_one_another",),
    "Large errors of odometry": (f"{STARTS}::test_much_odometry_error_is_corrected_by_the_walls",),
    "Unlucky starts": (
        f"{STARTS}::test_the_graph_is_reached_from_anywhere",
        f"{STARTS}::test_a_slot_that_the_robot_just_fits_into_is_left",
    ),
    "No loop at all": (f"{SHAPES}::test_a_tree_of_corridors_is_explored_without_a_loop",),
    "A frontier out of reach": (
        f"{PEOPLE}::test_a_person_who_never_goes_leaves_a_frontier_blocked",
    ),
    "A robot that does not get on": (
        f"{STARTS}::test_a_robot_that_does_not_get_on_backs_off_and_gives_up_in_the_end",
    ),
    "Killed while it wrote": (
        f"{FILES}::test_a_journal_that_was_cut_has_lost_its_last_batch_only",
        f"{FILES}::test_of_a_snapshot_that_was_cut_the_one_before_is_read",
    ),
    "Damaged files": (f"{FILES}::test_two_damaged_snapshots_are_named",),
}


def find() -> Finding:
    passed, failed = _outcomes([test for tests in SCENARIOS.values() for test in tests])
    rows = []
    for situation, tests in SCENARIOS.items():
        names = [test.rpartition("::")[2] for test in tests]
        good = sum(passed.get(name, 0) for name in names)
        bad = sum(failed.get(name, 0) for name in names)
        told = "; ".join(name.removeprefix("test_").replace("_", " ") for name in names)
        rows.append((situation, told, f"{good} of {good + bad}"))
    good, bad = sum(passed.values()), sum(failed.values())
    return Finding(
        title="Robustness",
        claim="What is degenerate is treated on purpose.",
        verdict=f"{good} of {good + bad} scenarios end as they should, in {len(SCENARIOS)} "
        "kinds of situations.",
        holds=bad == 0
        and all(passed.get(t.rpartition("::")[2]) for ts in SCENARIOS.values() for t in ts),
        figure="",
        explained="Each is a test of the suite, with the twins where there is something to drive.",
        table=(("situation", "what is shown", "passed"), *rows),
    )


def _outcomes(tests: list[str]) -> tuple[dict[str, int], dict[str, int]]:
    """How many cases of each test passed, and how many did not."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-m", "pytest", "-q", f"--junitxml={report}", *tests]
        subprocess.run(command, cwd=ROOT, check=False)
        cases = list(ElementTree.parse(report).iter("testcase"))
    passed: dict[str, int] = {}
    failed: dict[str, int] = {}
    for case in cases:
        name = case.attrib["name"].partition("[")[0]
        bad = any(part.tag in ("failure", "error", "skipped") for part in case)
        counts = failed if bad else passed
        counts[name] = counts.get(name, 0) + 1
    return passed, failed
