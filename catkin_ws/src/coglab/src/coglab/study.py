"""Many trials, on several processors."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, overload

from coglab.trial import Trial
from coglab.workers import run_each
from coglab.world import World

MOST_WORKERS = 256
Value = TypeVar("Value")


class TrialFailed(RuntimeError):
    """One of many trials raised an exception. ``seed``: its seed."""

    def __init__(self, sentence: str, seed: int) -> None:
        super().__init__(sentence, seed)
        self.seed = seed

    def __str__(self) -> str:
        return str(self.args[0])


@overload
def trials(
    n: int | None = None,
    *actions: str,
    seeds: Iterable[int] | None = None,
    workers: int = 2,
    each: None = None,
    limit: float = 60.0,
    **world: Any,
) -> list[Trial]: ...
@overload
def trials(
    n: int | None = None,
    *,
    seeds: Iterable[int] | None = None,
    workers: int = 2,
    each: Callable[[World], Value],
    limit: float = 60.0,
    **world: Any,
) -> list[Value]: ...
def trials(
    n: int | None = None,
    *actions: str,
    seeds: Iterable[int] | None = None,
    workers: int = 2,
    each: Callable[[World], Any] | None = None,
    limit: float = 60.0,
    **world: Any,
) -> list[Any]:
    """Run many trials, each in its own World, and return their records in the order of the seeds.

    ``n``: number of trials, with the seeds 1 .. n; or ``seeds``: these seeds. ``actions``: as for ``World.trial``,
    by default "receive". ``workers``: processes; 1: in this process. ``limit``: s of virtual time for each action.
    ``world``: further arguments of World, such as ``person="accustomed"``. ``each``: a function of a module, called
    with each World instead of the actions; its values are returned instead of Trials.

    Each worker is a new process, so a script needs ``if __name__ == "__main__":`` around this call.
    A trial that does not succeed is a Trial like others. TrialFailed names the seed of one that raised an exception.
    Example::

        trials = coglab.trials(100, "receive", "give", person="drawn")
        print(sum(map(bool, trials)), "of", len(trials))
    """
    chosen = _seeds(n, seeds)
    if isinstance(workers, bool) or not isinstance(workers, int) or not 1 <= workers <= MOST_WORKERS:
        raise ValueError(f"workers: a whole number 1 .. {MOST_WORKERS} is expected, got {workers!r}")
    if each is not None and actions:
        raise ValueError("give actions, or a function 'each', not both")
    jobs = [(seed, actions or ("receive",), limit, world, each) for seed in chosen]
    if workers == 1 or (len(jobs) == 1 and World.opened() is None):
        results: Iterable[tuple[int, Any]] = enumerate(map(_result, jobs))
    else:
        try:
            pickle.dumps((world, each))  # multiprocessing does this too; here the reason is reported
        except Exception as error:
            raise ValueError(
                f"these arguments cannot be sent to another process ({error}): use functions of a module instead of "
                "lambda or inner functions, or workers=1"
            ) from None
        results = run_each(_one, jobs, workers)
    found: dict[int, Any] = {}
    for index, result in results:
        if isinstance(result, (ValueError, TypeError)):
            raise result  # of the arguments: the same for each seed
        if isinstance(result, Exception):
            seed = chosen[index]
            words = f"the trial with seed {seed} failed: {type(result).__name__}: {result}"
            raise TrialFailed(words, seed) from result
        found[index] = result
    return [found[index] for index in range(len(jobs))]


def _seeds(n: int | None, seeds: Iterable[int] | None) -> list[int]:
    if (n is None) == (seeds is None):
        raise ValueError("give n, the number of trials, or seeds=..., not both")
    if seeds is not None:
        return list(seeds)
    if isinstance(n, bool) or not isinstance(n, int) or n < 1:
        raise ValueError(f"n: a whole number 1 or more is expected, got {n!r}")
    return list(range(1, n + 1))


def _one(job: tuple[int, tuple[str, ...], float, dict[str, Any], Callable[[World], Any] | None]) -> Trial | Any:
    seed, actions, limit, arguments, each = job
    with World(seed, **arguments) as world:
        return each(world) if each is not None else world.trial(*actions, limit=limit)


def _result(job: Any) -> Any:
    """The result of a trial, or the exception that it raised."""
    try:
        return _one(job)
    except Exception as error:
        return error
