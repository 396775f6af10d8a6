"""The command line: a table of the commands, whose functions are in `confab/commands/`.

Results go to stdout. Progress and errors go to stderr (`confab.terminal`). The exit code is 0 for a positive answer, 1 for a
negative answer, 2 for a wrong call or unreadable input, 3 if a limit was reached, and 4 for a fault of the program. The module of
a command is imported when the command is called. Slow imports are inside the functions that need them.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

import click
from click.exceptions import Exit

from confab.commands.options import QUIET
from confab.terminal import Ending, run_to_end

GROUPS = {
    "Plan and act": dict.fromkeys(("plan", "run", "verify", "execute", "explain"), "planning"),
    "Learn": dict.fromkeys(("learn", "memory"), "learning"),
    "Look": dict.fromkeys(("scenes", "report", "runs"), "reporting"),
    "Ask": {"query": "asking", "serve": "asking", "mcp": "asking", "picture": "authoring"},
    "Author": dict.fromkeys(("validate", "new", "generate", "convert", "fetch"), "authoring"),
    "Exchange": dict.fromkeys(("import", "export"), "authoring"),
}
"""The groups of commands in the order of the help; each command has the name of its module in `confab/commands/`."""
FUNCTIONS = {"import": "import_", "memory": "memory_app"}
"""The functions that don't have the name of their command."""
COMMANDS = {name: (module, FUNCTIONS.get(name, name)) for group in GROUPS.values() for name, module in group.items()}
SETTINGS = {"help_option_names": ["-h", "--help"], "show_default": True}


class Commands(click.Group):
    """The group of all commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        return list(COMMANDS)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands, grouped by purpose."""
        width = max(map(len, COMMANDS))
        for title, names in GROUPS.items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                room = formatter.width - 6 - width
                formatter.write_dl([(name.ljust(width), its.get_short_help_str(room)) for name, its in commands if its])

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; ``help COMMAND`` means ``COMMAND --help``."""
        return super().parse_args(ctx, [*args[1:2], "--help"] if args[:1] == ["help"] else args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command with a name; for an unknown name, the error suggests the most similar name."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            from confab.commands.misplaced import known_as
            from confab.guessing import command
            from confab.reasoner.names import nearest

            if said := known_as(args[:1], ctx):
                raise click.UsageError(said, ctx)
            meant = command(args[0], COMMANDS)
            hint = f"; did you mean '{meant}'?" if meant else nearest(args[0], [*COMMANDS, "help"])
            raise click.UsageError(f"no such command '{args[0]}'{hint}", ctx)
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command with a name, or None if there is no such command."""
        if cmd_name not in COMMANDS:
            return None
        module, function = COMMANDS[cmd_name]
        command: click.Command = getattr(import_module(f"confab.commands.{module}"), function)
        return command


def _version(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted:
        from confab import __version__

        print(f"confab {__version__}")
        raise Exit


def _completion(context: click.Context, option: click.Parameter, shell: str | None) -> None:
    if shell:
        from click.shell_completion import get_completion_class

        kind = get_completion_class(shell)
        assert kind is not None
        print(kind(app, {}, "confab", "_CONFAB_COMPLETE").source())
        raise Exit


@click.group(name="confab", cls=Commands, context_settings=SETTINGS)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Print the version and exit."
)
@click.option(
    "--completion",
    type=click.Choice(["bash", "zsh", "fish"]),
    is_eager=True,
    expose_value=False,
    callback=_completion,
    help='Print the script that completes commands, scenes and files: eval "$(confab --completion bash)".',
)
@QUIET
def app() -> None:
    """Plan for a robot whose knowledge is an ontology, and verify plans in physics."""


def main(arguments: Sequence[str] | None = None, ending: Ending | None = None) -> NoReturn:
    """Run the command line, and end the process with an exit code and at most one line on stderr.

    If a step continues long after its deadline, `ending` is called to end the process. If another program calls `main` without
    `ending`, no deadline ends the process.
    """
    run_to_end(lambda: app(arguments, prog_name="confab", standalone_mode=False, obj=ending))
