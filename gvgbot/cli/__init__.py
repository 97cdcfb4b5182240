"""The command line: `entry` starts a command; those that belong together share a module."""

from gvgbot.cli.entry import main, parser, status_of

__all__ = ["main", "parser", "status_of"]
