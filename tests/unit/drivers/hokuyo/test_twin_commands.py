"""How a laser cuts what a host types into commands."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from gvgbot.drivers.hokuyo.twin_commands import COMMAND_LIMIT, CommandReader

endings = st.sampled_from((b"\n", b"\r", b"\r\n", b"\n\n"))
commands = st.text(
    st.characters(max_codepoint=255, exclude_characters="\r\n"), min_size=1, max_size=COMMAND_LIMIT
)


@given(st.lists(st.tuples(commands, endings)))
def test_commands_are_read_as_they_were_typed(typed: list[tuple[str, bytes]]) -> None:
    data = b"".join(command.encode("latin-1") + ending for command, ending in typed)
    assert CommandReader().feed(data) == [command for command, _ in typed]


@given(st.lists(st.tuples(commands, endings), min_size=1), st.lists(st.integers(0)))
def test_any_chunking_gives_the_same_commands(
    typed: list[tuple[str, bytes]], cuts: list[int]
) -> None:
    data = b"".join(command.encode("latin-1") + ending for command, ending in typed)
    edges = [0, *sorted(cut % len(data) for cut in cuts), len(data)]
    reader = CommandReader()
    found = [command for start, end in pairwise(edges) for command in reader.feed(data[start:end])]
    assert found == [command for command, _ in typed]


@given(st.lists(st.binary(max_size=300)), commands)
def test_the_command_after_noise_is_found(noise: list[bytes], command: str) -> None:
    reader = CommandReader()
    for chunk in noise:
        reader.feed(chunk)
    reader.feed(b"\n")
    assert reader.feed(command.encode("latin-1") + b"\r") == [command]
