"""Comparison of messages with the facts that they must contain."""

from collections.abc import Iterable, Sequence

GAP = " ... "
"""Separator of two facts."""


def states(message: str, facts: str) -> bool:
    """Return True if a message contains all facts in the given order.

    Tests compare the facts of a message, not its sentence, so that the sentence can be improved
    without a change of the tests.

    Parameters
    ----------
    message : str
        Message, or several lines with messages.
    facts : str
        Facts: file, line, key, value, number or name. Any text may take the place of ` ... `.
    """
    place = 0
    for fact in facts.split(GAP):
        found = message.find(fact, place)
        if found < 0:
            return False
        place = found + len(fact)
    return True


def each_states(messages: Iterable[str], facts: Sequence[str]) -> bool:
    """Return True if there are as many messages as facts, and each states its facts."""
    found = list(messages)
    return len(found) == len(facts) and all(map(states, found, facts))
