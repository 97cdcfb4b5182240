"""Writes reference/cli.md, all commands with their options, from the parser in gvgbot/cli/.

python -m docs.make_cli
"""

import argparse
import textwrap
from collections.abc import Iterator
from pathlib import Path

from docs.source import table
from gvgbot.cli import parser

PAGE = Path(__file__).parent / "reference" / "cli.md"
GLUE = "\0"  # stands for a blank at which a line must not be broken
HEAD = """\
# Command line

<!-- Written by docs/make_cli.py from gvgbot/cli/: change the parser there, not here. -->

Every command has `--help`. The exit status is 0 when a command did what it was asked for, 1 when
it failed, and 2 when it was asked wrongly; for 1 and 2 a line on stderr says why (`map diff` says
on stdout what differs). After Ctrl-C it is 0 if the command goes on until it is told to end (`run`,
`twin`, `monitor`, `web`, `replay --serve`), else 130; `explore` and `replay` save the map as it is
then. `CONFIG` is a file, or the name of a packaged one: `sim.yaml`, `turtlebot2.yaml`,
`husky.yaml`, `carmen.yaml`.
"""


def page() -> str:
    """The whole page, Markdown."""
    leaves = list(_leaves(parser()))
    rows = [
        (f"[`{parser.prog}`](#{parser.prog.replace(' ', '-')})", text) for parser, text in leaves
    ]
    overview = table(("command", "does"), rows)
    return "\n".join([HEAD, overview, *(_section(parser) for parser, _ in leaves)])


def _leaves(parser: argparse.ArgumentParser) -> Iterator[tuple[argparse.ArgumentParser, str]]:
    """The commands that have no commands of their own, with their one-line help."""
    for action in parser._actions:
        if not isinstance(action, argparse._SubParsersAction):
            continue
        helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
        for name, command in action.choices.items():
            deeper = list(_leaves(command))
            yield from deeper or [(command, helps[name])]


def _section(parser: argparse.ArgumentParser) -> str:
    rows = [(_form(action), _meaning(action)) for action in _arguments(parser)]
    example = (parser.epilog or "").removeprefix("example: ")
    return (
        f"## `{parser.prog}`\n\n{parser.description}\n\n"
        f"```\n{_usage(parser)}\n```\n\n{table(('argument', 'meaning'), rows)}\n"
        f"```sh\n{example}\n```\n"
    )


def _arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """All but --help, those without a name first."""
    actions = [a for a in parser._actions if not isinstance(a, argparse._HelpAction)]
    return sorted(actions, key=lambda action: bool(action.option_strings))


def _usage(parser: argparse.ArgumentParser) -> str:
    if parser.usage is not None:
        usage = " ".join((parser.usage % {"prog": parser.prog}).split())
        return usage.replace("[-h] ", "").replace("] ", "]\n    ", 1)
    parts = [_form(action).strip("`") for action in _arguments(parser)]
    is_free = [action.required for action in _arguments(parser)]
    words = (part if must else f"[{part}]" for part, must in zip(parts, is_free, strict=True))
    joined = " ".join(
        [parser.prog.replace(" ", GLUE), *(word.replace(" ", GLUE) for word in words)]
    )
    lines = textwrap.fill(joined, 76, subsequent_indent="    ", break_on_hyphens=False)
    return lines.replace(GLUE, " ")


def _form(action: argparse.Action) -> str:
    """As it is typed."""
    metavar = action.metavar or action.dest.upper()
    value = " ".join(metavar) if isinstance(metavar, tuple) else metavar
    if not action.option_strings:
        return f"`{value}`"
    return (
        f"`{action.option_strings[-1]}`"
        if action.nargs == 0
        else f"`{action.option_strings[-1]} {value}`"
    )


def _meaning(action: argparse.Action) -> str:
    return (action.help or "") % {"default": action.default}


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
