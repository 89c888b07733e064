"""Groups of verbs: a bare one shows its help, a mistyped one gets a suggestion."""

import difflib
from collections.abc import Sequence
from typing import Any

import click


class VerbGroup(click.Group):
    """A group that shows its help when called without a verb (exit 0), and suggests a verb for a mistyped one."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args and not ctx.resilient_parsing:
            click.echo(ctx.get_help(), color=ctx.color)
            ctx.exit(0)
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            ctx.fail(f"there is no verb {args[0]!r}{self.suggestion(ctx, args[0])}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """As click's, with the whole sentence of each verb."""
        verbs = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl([(name, verb.get_short_help_str(limit=200)) for name, verb in verbs if verb])

    def suggestion(self, ctx: click.Context, name: str) -> str:
        """`; did you mean ...?`, or an empty string where no verb is similar."""
        known = self.list_commands(ctx)
        word = name.lower().replace("_", "-")
        near = [k for k in known if word and (k.startswith(word) or word.startswith(k))]
        near += difflib.get_close_matches(word, known, n=2, cutoff=0.55)
        found = list(dict.fromkeys(near))[:2]
        return f"; did you mean {' or '.join(found)}?" if found else ""


class DefaultVerbGroup(VerbGroup):
    """A group that is a verb too: `goshawk plan WAYPOINTS` beside `goshawk plan batch`."""

    def __init__(self, name: str, own: click.Command, commands: Sequence[click.Command]) -> None:
        super().__init__(name, commands=commands, help=own.help)
        self.own = own

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        if args and args[0] in self.commands:
            return super().make_context(info_name, args, parent, **extra)
        return self.own.make_context(info_name, args, parent, **extra)
