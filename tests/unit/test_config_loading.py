"""Strict loading: what fits is read, and every mistake is listed with what is allowed."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gvgbot.errors import ConfigError
from gvgbot.ranges import Range
from gvgbot.strict_yaml import as_mapping, dump, load


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    length_m: Annotated[float, Range(0.1, 2.0)] = 0.5
    toes: Annotated[int, Range(1, None)] = 3
    longest_m: Annotated[float | None, Range(None, 5.0)] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Animal:
    name: str = "dog"
    tame: bool = True
    weight_kg: float = 8.0
    diet: Literal["grass", "meat", 7] = "meat"
    home: Path = Path("den")
    position: tuple[float, float] | None = None
    bites: tuple[Annotated[float, Range(0.0, None)], ...] = ()
    leg: Leg = field(default_factory=Leg)
    spare: Leg | None = None
    shortest_m: float = 1.0
    tallest_m: float = 2.0

    def __post_init__(self) -> None:
        if self.shortest_m > self.tallest_m:
            raise ValueError("shortest_m must be at most tallest_m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Needy:
    port: str
    speed_mps: float = 0.2


def loaded(text: str, tmp_path: Path, *overrides: str) -> Animal:
    path = tmp_path / "animal.yaml"
    path.write_text(text, encoding="utf-8")
    return load(Animal, path, overrides)


def mistakes(text: str, tmp_path: Path, *overrides: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        loaded(text, tmp_path, *overrides)
    return [line.replace(f"{tmp_path}/", "") for line in str(caught.value).splitlines()]


def test_no_file_and_no_override_give_the_defaults() -> None:
    assert load(Animal, None) == Animal()


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "leg:\n", "{}"])
def test_an_empty_file_or_section_gives_the_defaults(text: str, tmp_path: Path) -> None:
    assert loaded(text, tmp_path) == Animal()


def test_every_kind_of_value_is_read(tmp_path: Path) -> None:
    text = """
    name: Rex
    tame: false
    weight_kg: 12
    diet: 7
    home: /kennel
    position: [1, 2.5]
    bites: [1e-3, 2, 0.0]
    leg: {length_m: 1.0, toes: 4, longest_m: 3.0}
    spare: {toes: 1}
    """
    assert loaded(text, tmp_path) == Animal(
        name="Rex",
        tame=False,
        weight_kg=12.0,
        diet=7,
        home=Path("/kennel"),
        position=(1.0, 2.5),
        bites=(0.001, 2.0, 0.0),
        leg=Leg(length_m=1.0, toes=4, longest_m=3.0),
        spare=Leg(toes=1),
    )


def test_a_whole_number_becomes_a_float_where_a_float_is_due(tmp_path: Path) -> None:
    assert type(loaded("weight_kg: 3", tmp_path).weight_kg) is float


WRONG = {
    "text for a number": ("weight_kg: heavy", "weight_kg = 'heavy': must be a number"),
    "true for a number": ("weight_kg: true", "weight_kg = true: must be a number"),
    "nan": ("weight_kg: .nan", "weight_kg = nan: must be a number"),
    "infinity": ("weight_kg: -.inf", "weight_kg = -inf: must be a number"),
    "beyond floats": ("weight_kg: 1" + 400 * "0", "must be a number"),
    "null for a number": ("weight_kg:", "weight_kg = null: must be a number"),
    "number for text": ("name: 7", 'name = 7: must be text: write "7", in a shell \'"7"\''),
    "date for text": ("name: 2020-02-03", "must be text"),
    "number for a flag": ("tame: 1", "tame = 1: must be true or false"),
    "fraction for a whole": ("leg: {toes: 2.0}", "leg.toes = 2.0: must be a whole number"),
    "true for a whole": ("leg: {toes: true}", "leg.toes = true: must be a whole number"),
    "too small": ("leg: {length_m: 0.09}", "leg.length_m = 0.09: must be a number from 0.1 to 2"),
    "too large": ("leg: {length_m: 2.1}", "leg.length_m = 2.1: must be a number from 0.1 to 2"),
    "below a half-open range": (
        "leg: {toes: 0}",
        "leg.toes = 0: must be a whole number of at least 1",
    ),
    "above an optional range": ("leg: {longest_m: 6}", "or null of at most 5"),
    "not a choice": ("diet: fish", "diet = 'fish': must be one of grass, meat, 7"),
    "choice of another type": ("diet: '7'", "diet = '7': must be one of grass, meat, 7"),
    "no end of text": ('name: "a\\0b"', "must be text"),
    "no end of a path": ('home: "a\\0b"', "must be a path"),
    "empty path": ("home: ''", "home = '': must be a path"),
    "short tuple": ("position: [1]", "position = [1]: must be a list of 2"),
    "text in a tuple": ("position: [1, x]", "position = [1, 'x']: must be a list of 2"),
    "item out of range": ("bites: [1, -2]", "bites[1] = -2: must be a number of at least 0"),
    "scalar for a list": (
        "bites: 3",
        "bites = 3: must be a list, each a number of at least 0: write [3]",
    ),
    "what no list of it would take": ("bites: -3", "must be a list, each a number of at least 0"),
    "scalar for a section": ("leg: 3", "leg = 3: must be a mapping"),
    "list for a section": ("leg: [3]", "leg = [3]: must be a mapping"),
    "inside an optional section": ("spare: {toes: 0}", "spare.toes = 0: must be a whole number"),
    "unknown key": ("wieght_kg: 3", "wieght_kg = 3: no such key; did you mean weight_kg?"),
    "unknown nested key": ("leg: {toe: 3}", "leg.toe = 3: no such key; did you mean leg.toes?"),
    "key of a section": ("toes: 3", "toes = 3: no such key; did you mean leg.toes?"),
    "unlike any key": ("leg: {q: 3}", "leg.q = 3: no such key; here are length_m, toes, longest_m"),
    "key that is no text": ("1: 2", "1 = 2: no such key"),
    "fields at odds": ("shortest_m: 3", "the whole: shortest_m must be at most tallest_m"),
}


@pytest.mark.parametrize(("text", "expected"), WRONG.values(), ids=WRONG)
def test_a_mistake_names_file_key_value_and_what_is_allowed(
    text: str, expected: str, tmp_path: Path
) -> None:
    (line,) = mistakes(text, tmp_path)
    assert line.startswith("animal.yaml: ")
    assert expected in line


def test_every_mistake_of_a_file_and_of_the_overrides_is_listed_at_once(tmp_path: Path) -> None:
    text = "{nmae: x, tame: 3, weight_kg: heavy, leg: {toes: 0, length_m: .nan}, position: [1, b]}"
    lines = mistakes(text, tmp_path, "diet=fish", "leg.tose=3", "oops")
    assert len(lines) == 9
    sources = sorted(line.split(":")[0] for line in lines)
    assert sources[:3] == ["--set diet=fish", "--set leg.tose=3", "--set oops"]
    assert sources[3:] == ["animal.yaml"] * 6


def test_a_file_of_something_else_is_told_once_which_keys_there_are(tmp_path: Path) -> None:
    lines = mistakes("{q: 3, '?': 4, nmae: x}", tmp_path)
    assert ["; here are name, " in line for line in lines] == [True, False, False]
    assert all("no such key" in line for line in lines)


UNREADABLE = {
    "a list": ("- 1\n- 2\n", "must be a mapping"),
    "a scalar": ("hello\n", "must be a mapping"),
    "bad syntax": ("name: a\nleg: {toes: 3\nhome: b\n", "not valid YAML: line 3, column 5"),
    "a tab": ("leg:\n\ttoes: 3\n", "line 2, column 1"),
    "a key given twice": (
        "name: a\ntame: true\nname: b\n",
        "line 3, column 1: the key name is given twice",
    ),
    "a nested key given twice": ("leg:\n  toes: 3\n  toes: 4\n", "line 3, column 3"),
    "two documents": ("name: a\n---\nname: b\n", "not valid YAML"),
    "an impossible date": ("name: 2020-13-45\n", "not valid YAML"),
    "a python object": ("name: !!python/object:os.system a\n", "not valid YAML: line 1"),
    "a tag of another value": ("tame: !!bool x\n", "line 1, column 7: the value is no !!bool"),
    "a tag of no number": ('leg: [!!float "", 2]\n', "column 7: the value is no !!float"),
    "a tag of no whole number": ('leg: {toes: !!int "-"}\n', "the value is no !!int"),
    "a tag of no date": ("name: !!timestamp x\n", "the value is no !!timestamp"),
    "a list for a key": ("[1]: 2\n", "line 1, column 1"),
}


@pytest.mark.parametrize(("text", "expected"), UNREADABLE.values(), ids=UNREADABLE)
def test_an_unreadable_file_is_one_clear_line(text: str, expected: str, tmp_path: Path) -> None:
    (line,) = mistakes(text, tmp_path)
    assert line.startswith("animal.yaml: ")
    assert expected in line


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"absent\.yaml: cannot read the file: No such file"):
        load(Animal, tmp_path / "absent.yaml")


def test_a_directory_is_no_configuration(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read the file"):
        load(Animal, tmp_path)


@pytest.mark.parametrize("name", [b"\xff\xfe\x00", "Löwe".encode("latin-1")])
def test_a_file_in_another_encoding_is_no_configuration(name: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_bytes(b"name: " + name)
    with pytest.raises(ConfigError, match=r"a\.yaml: not text in UTF-8"):
        load(Animal, tmp_path / "a.yaml")


def test_overrides_win_over_the_file_and_later_ones_over_earlier(tmp_path: Path) -> None:
    animal = loaded("{name: a, leg: {toes: 2}}", tmp_path, "leg.toes=5", "name=b", "name=c")
    assert (animal.name, animal.leg.toes) == ("c", 5)


def test_an_override_leaves_the_rest_of_its_section_as_the_file_says(tmp_path: Path) -> None:
    assert loaded("leg: {toes: 2}", tmp_path, "leg.length_m=1").leg == Leg(toes=2, length_m=1.0)


def test_overrides_take_lists_exponents_and_quoted_text() -> None:
    animal = load(Animal, None, ["position=[1, -2]", "weight_kg=1e-3", "name='7'", "tame=false"])
    assert animal == Animal(position=(1.0, -2.0), weight_kg=0.001, name="7", tame=False)


def test_an_override_can_make_an_optional_section(tmp_path: Path) -> None:
    assert loaded("", tmp_path, "spare.toes=2").spare == Leg(toes=2)


def test_an_override_does_not_hide_a_mistake_of_the_file(tmp_path: Path) -> None:
    (line,) = mistakes("leg: {toes: 0}", tmp_path, "leg.toes=3")
    assert line.startswith("animal.yaml: leg.toes = 0")


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("name", "must be key=value"),
        ("=3", "must be key=value"),
        ("leg..toes=3", "must be key=value"),
        ("name=[1", "the value is not valid YAML"),
        ("tame=!!bool x", "the value is not valid YAML: line 1, column 1: the value is no !!bool"),
        ("leg=3", "leg = 3: must be a mapping"),
        ("name.first=Rex", "name: must be text"),
        ("leg.toes=0", "leg.toes = 0: must be a whole number of at least 1"),
        ("leg.toess=1", "did you mean leg.toes?"),
        ("lag.toes=1", "did you mean leg?"),
        ("tallest_m=0.5", "shortest_m must be at most tallest_m"),
    ],
)
def test_a_wrong_override_is_named(override: str, expected: str, tmp_path: Path) -> None:
    (line,) = mistakes("name: Rex", tmp_path, override)
    assert line.startswith(f"--set {override}: ")
    assert expected in line


def test_a_plain_value_is_not_lost_to_a_key_in_it(tmp_path: Path) -> None:
    (line,) = mistakes("leg: {toes: 3}", tmp_path, "leg=3", "leg.toes=2", "leg.length_m=1")
    assert line == "--set leg=3: cannot go with --set leg.toes=2, a key in it"
    assert loaded("", tmp_path, "leg=", "leg.toes=2").leg.toes == 2
    assert loaded("", tmp_path, "leg={length_m: 1}", "leg.toes=2").leg == Leg(length_m=1.0, toes=2)


@pytest.mark.parametrize("others", [(), ("name=Rex",), ("name=Rex", "leg.toes=2")])
def test_a_wrong_combination_is_blamed_on_the_override_that_made_it_wrong(
    others: tuple[str, ...], tmp_path: Path
) -> None:
    (line,) = mistakes("name: Max", tmp_path, *others, "tallest_m=0.5", *others)
    assert line.startswith("--set tallest_m=0.5: ")


def test_a_required_key_that_is_missing_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "needy.yaml"
    path.write_text("speed_mps: 0.1", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"needy\.yaml: port: is missing"):
        load(Needy, path)


def test_an_override_supplies_a_required_key(tmp_path: Path) -> None:
    path = tmp_path / "needy.yaml"
    path.write_text("speed_mps: 0.1", encoding="utf-8")
    assert load(Needy, path, ["port=/dev/x"]) == Needy(port="/dev/x", speed_mps=0.1)


def test_a_long_value_does_not_flood_the_message(tmp_path: Path) -> None:
    (line,) = mistakes(f"weight_kg: {'x' * 10_000}", tmp_path)
    assert len(line) < 200


numbers = st.floats(allow_nan=False, allow_infinity=False)
animals = st.builds(
    Animal,
    name=st.text(st.characters(codec="utf-8", exclude_categories=["C"])),
    tame=st.booleans(),
    weight_kg=numbers,
    diet=st.sampled_from(["grass", "meat", 7]),
    home=st.sampled_from([Path("a b"), Path("/x/y"), Path("1"), Path("true"), Path("~")]),
    position=st.none() | st.tuples(numbers, numbers),
    bites=st.lists(st.floats(0.0, math.e)).map(tuple),
    leg=st.builds(Leg, length_m=st.floats(0.1, 2.0), toes=st.integers(1, 10**6)),
    spare=st.none() | st.just(Leg(toes=9)),
)


@given(animals)
def test_what_is_dumped_loads_again(
    tmp_path_factory: pytest.TempPathFactory, animal: Animal
) -> None:
    path = tmp_path_factory.getbasetemp() / "dumped.yaml"
    path.write_text(dump(animal), encoding="utf-8")
    assert load(Animal, path) == animal


@given(animals)
def test_the_effective_configuration_is_plain_json(animal: Animal) -> None:
    mapping = as_mapping(animal)
    assert json.loads(json.dumps(mapping)) == mapping
    assert mapping["leg"]["toes"] == animal.leg.toes
