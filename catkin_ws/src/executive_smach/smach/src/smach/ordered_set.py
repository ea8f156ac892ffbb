"""A set that keeps the order in which its elements were added."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, MutableSet


class OrderedSet(MutableSet):
    """Outcomes and keys in the order of their declaration, so that pictures and messages are stable.

    Behaves like `set` (operators, `update`, `union`); iterates in the order of first insertion.

    Example::

        >>> tuple(OrderedSet(["b", "a", "b"]))
        ('b', 'a')
    """

    def __init__(self, items: Iterable[Hashable] = ()) -> None:
        self._items: dict[Hashable, None] = dict.fromkeys(items)

    def __contains__(self, item: object) -> bool:
        return item in self._items

    def __iter__(self) -> Iterator:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def add(self, value: Hashable) -> None:
        """Append `value` unless it is present. Example: `s.add("done")`."""
        self._items[value] = None

    def discard(self, value: Hashable) -> None:
        """Remove `value` if it is present. Example: `s.discard("done")`."""
        self._items.pop(value, None)

    def update(self, *others: Iterable[Hashable]) -> None:
        """Append the new elements of `others`. Example: `s.update(["a"], ["b"])`."""
        for other in others:
            self._items.update(dict.fromkeys(other))

    def union(self, *others: Iterable[Hashable]) -> OrderedSet:
        """New set of this set's elements, followed by those of `others`. Example: `s.union(["a"])`."""
        result = OrderedSet(self)
        result.update(*others)
        return result

    def __repr__(self) -> str:
        return f"OrderedSet({list(self._items)!r})"


def names(what: str, items: Iterable[str]) -> tuple[str, ...]:
    """`items` as a tuple. Raises a TypeError with an explanation for a single string, a frequent mistake.

    Example: `names("outcomes", ["done", "failed"])`.
    """
    if isinstance(items, (str, bytes)):
        raise TypeError(f"{what}: expected a list of names, got the single string {items!r}; write [{items!r}]")
    try:
        return tuple(items)
    except TypeError:
        raise TypeError(f"{what}: expected a list of names, got {type(items).__name__}") from None
