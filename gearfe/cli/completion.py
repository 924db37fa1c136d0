"""``gearfe completion SHELL``: a script that completes commands, options and their choices."""

from __future__ import annotations

import argparse
import shlex
from typing import Any

#: Where a shell looks for it.
WHERE = {
    "bash": "gearfe completion bash > ~/.local/share/bash-completion/completions/gearfe",
    "zsh": "gearfe completion zsh >> ~/.zshrc",
    "fish": "gearfe completion fish > ~/.config/fish/completions/gearfe.fish",
}
BASH = """
_gearfe() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" words=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{commands}" -- "$word")); return
    fi
    case "${{COMP_WORDS[1]}} $before" in
{choices}
    esac
    if [ -z "$words" ]; then
        case "$word" in -*) ;; *) COMPREPLY=(); return ;; esac
        case "${{COMP_WORDS[1]}}" in
{options}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -o bashdefault -F _gearfe gearfe
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("shell", metavar="SHELL", help=", ".join(WHERE))


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from ..base.errors import unknown_name

    if args.shell not in WHERE:
        raise unknown_name("shell", args.shell, WHERE)
    print(f"# Completion of gearfe, made by: {WHERE[args.shell]}")
    print(_fish() if args.shell == "fish" else _bash(zsh=args.shell == "zsh"))
    return 0


def _commands() -> dict[str, tuple[str, list[Any]]]:
    """Command -> its one line, and its options."""
    from . import COMMANDS
    from .arguments import command_module, parser_of

    found = {}
    for name, texts in COMMANDS.items():
        actions = parser_of(command_module(name), f"gearfe {name}", *texts)._actions  # argparse offers no other way
        found[name] = (texts[0], [a for a in actions if a.option_strings and a.help != argparse.SUPPRESS])
    return found


def _choices(action: Any) -> list[str]:
    """Words that an option takes, where it takes some words only."""
    if action.choices:
        return [str(choice) for choice in action.choices]
    text = action.metavar if isinstance(action.metavar, str) else ""
    return text.split("|") if "|" in text else []


def _bash(*, zsh: bool) -> str:
    commands = _commands()
    choices, options = [], []
    for name, (_, actions) in commands.items():
        options.append(f'            {name}) words="{" ".join(a.option_strings[-1] for a in actions)}" ;;')
        for action in actions:
            if words := _choices(action):
                cases = "|".join(f'"{name} {option}"' for option in action.option_strings)
                choices.append(f'        {cases}) words="{" ".join(words)}" ;;')
    text = BASH.format(commands=" ".join(commands), choices="\n".join(choices), options="\n".join(options))
    return ("autoload -U +X compinit bashcompinit && compinit && bashcompinit\n" if zsh else "") + text


def _fish() -> str:
    lines = []
    for name, (help_text, actions) in _commands().items():
        lines.append(f"complete -c gearfe -n __fish_use_subcommand -a {name} -d {shlex.quote(help_text)}")
        for action in actions:
            long = action.option_strings[-1].removeprefix("--")
            words = _choices(action)
            takes = f" -x -a {shlex.quote(' '.join(words))}" if words else "" if action.nargs == 0 else " -r"
            described = shlex.quote((action.help or "").replace("%%", "%"))
            lines.append(f"complete -c gearfe -n '__fish_seen_subcommand_from {name}' -l {long}{takes} -d {described}")
    return "\n".join(lines)
