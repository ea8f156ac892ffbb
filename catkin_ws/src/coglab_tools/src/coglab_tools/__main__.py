# PYTHON_ARGCOMPLETE_OK
"""`python3 -m coglab_tools NOUN VERB [ARG ...]`, which `./coglab NOUN VERB` calls.

Exit codes: 0 done, 1 a check failed, 2 invalid arguments, 3 robot, ROS or a library is missing.
"""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import nullcontext, redirect_stdout
from importlib import import_module
from typing import NoReturn

from coglab_tools.command import NOT_THERE, CommandError, CommandResult, UsageError, working

NOUNS = ("dmp", "people", "trial", "study")
TALKATIVE = {("dmp", "record"), ("trial", "replay"), ("study", "ask"), ("study", "run"), ("study", "resume")}
"""verbs that print or ask while they run, and so have no bar from beginning to end"""


class Parser(argparse.ArgumentParser):
    """An argument parser that refuses with one sentence instead of a usage block."""

    def error(self, message: str) -> NoReturn:
        """Raise UsageError; argparse calls this."""
        raise UsageError(f"{message}; the options: ./{self.prog} --help")


def make_parser(chosen: str = "") -> Parser:
    """The parser of all nouns; `chosen`: add only the verbs of this noun ("": of all)."""
    parser = Parser(prog="coglab", description="The researcher's daily commands.")
    nouns = parser.add_subparsers(metavar="NOUN", required=True, dest="noun", parser_class=Parser)
    for name in NOUNS:
        if chosen in ("", name):
            module = import_module(f"coglab_tools.{name}.commands")
            noun = nouns.add_parser(name, help=module.HELP, description=module.HELP)
            verbs = noun.add_subparsers(metavar="VERB", required=True, dest="verb", parser_class=Parser)
            module.add(verbs)
            for verb in verbs.choices.values():
                verb.add_argument("--json", action="store_true", help="print the answer as JSON")
        else:
            nouns.add_parser(name)
    return parser


def run(words: list[str]) -> int:
    """Run a command and print its answer. Returns the exit code."""
    as_json = "--json" in words
    try:
        parser = make_parser(words[0] if words and words[0] in NOUNS else "")
        try:
            import argcomplete

            argcomplete.autocomplete(parser, always_complete_options=False)
        except ImportError:  # only completion needs it
            pass
        options = parser.parse_args(words)
        as_json = options.json
        with redirect_stdout(sys.stderr if as_json else sys.stdout):  # prompts too: the answer is alone on stdout
            talks = (options.noun, options.verb) in TALKATIVE
            with nullcontext() if talks else working(f"{options.noun} {options.verb}"):
                answer: CommandResult = options.run(options)
    except CommandError as error:
        return _refuse(str(error), error.status, as_json)
    except ModuleNotFoundError as error:
        return _refuse(f"the library {error.name} is missing; ./coglab install tools gets it", NOT_THERE, as_json)
    except KeyboardInterrupt as error:
        return _refuse(str(error) or "ended by Ctrl-C; the finished part is kept", 130, as_json)
    if as_json:
        print(json.dumps(answer.data, indent=1, default=str))
    else:
        print(answer.text)
        if answer.next:
            print(f"next: {answer.next}")
    return answer.status


def _refuse(sentence: str, status: int, as_json: bool) -> int:
    if as_json:
        print(json.dumps({"error": sentence, "status": status}))
    print(f"[coglab] error: {sentence}", file=sys.stderr)
    return status


def main() -> int:
    """Command line. A reader that ends early, such as `| head`, is no error."""
    try:
        return run(sys.argv[1:])
    except BrokenPipeError:
        sys.stderr.close()
        return 0


if __name__ == "__main__":
    sys.exit(main())
