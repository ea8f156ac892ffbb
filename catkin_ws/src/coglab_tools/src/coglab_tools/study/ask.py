"""Fills in the questionnaires of a participant on the terminal."""

from __future__ import annotations

from collections.abc import Callable

from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.study.plan import Study
from coglab_tools.study.questionnaires import AnswerRow, Questionnaire, add_answers, open_items


def ask(study: Study, participant: str, condition: str = "", block: int = 0, line: Callable[[str], str] = input) -> int:
    """Ask for each unanswered item, and write the answers of each questionnaire at its end.

    ``condition``: "": all, in the participant's order. ``block``: 0: all. ``line``: reads a line after a prompt. A line
    "skip" leaves an item out, "back" returns to the one before. Returns the number of answers.
    """
    if not study.questionnaires:
        raise CheckFailed(
            f"{study.folder}/study.yaml names no questionnaires: add a line such as questionnaires: [nasa_tlx]"
        )
    if condition and condition not in study.conditions:
        raise UsageError(f"--condition: one of {', '.join(study.conditions)} is expected, got '{condition}'")
    visits = dict.fromkeys(t.visit for t in study.trials() if t.participant == participant)
    missing = open_items(study, visits)
    count = 0
    for _, visit, shown in visits:
        if condition in ("", shown) and block in (0, visit):
            for questionnaire in study.questionnaires:
                head = (participant, visit, shown, questionnaire.name)
                items = missing[head[:3]].get(questionnaire.name)
                if not items:
                    continue
                say = f"{participant}, condition {shown}" + (f", block {visit}" if study.blocks > 1 else "")
                answers: dict[str, float] = {}
                try:
                    _items(questionnaire, items, say, line, answers)
                except EOFError:
                    return count + len(answers)
                finally:  # also after Ctrl-C: answers are kept, the other items come next time
                    if answers:
                        add_answers(study, [AnswerRow(*head, item, answer) for item, answer in answers.items()])
                count += len(answers)
    return count


def _items(
    questionnaire: Questionnaire, items: list[str], say: str, line: Callable[[str], str], answers: dict[str, float]
) -> None:
    """Ask for the items, and store the answers in ``answers``."""
    print(f"\n{questionnaire.title}: {say}")
    print(
        f"  {questionnaire.low:g} = {questionnaire.ends[0]}, {questionnaire.high:g} = {questionnaire.ends[1]}; "
        "skip leaves an item out, back returns to the one before"
    )
    place = 0
    while place < len(items):
        given = line(f"  {place + 1}/{len(items)} {questionnaire.shown(items[place])}: ").strip().lower()
        if given == "back":
            place = max(0, place - 1)
        elif given == "skip":
            answers.pop(items[place], None)
            place += 1
        else:
            try:
                answer = float(given)
                sentence = questionnaire.problem(answer)
            except ValueError:
                answer, sentence = 0.0, f"a number is expected, got '{given}'"
            if sentence:
                print(f"    {sentence}")
            else:
                answers[items[place]] = answer
                place += 1
