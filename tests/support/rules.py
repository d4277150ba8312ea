"""A rule of the project held against all that it is for, in one test."""

from collections.abc import Callable, Iterable


def each(
    find: Callable[[], Iterable[tuple]],
) -> Callable[[Callable[..., None]], Callable[[], None]]:
    """Make one test of a rule and the cases that `find` returns: it names every case that breaks
    the rule.

    A case is named by its first argument. The cases are found when the test runs, as every process
    collects all tests.
    """

    def over(rule: Callable[..., None]) -> Callable[[], None]:
        def test_each() -> None:
            cases, faults = list(find()), []
            for case in cases:
                try:
                    rule(*case)
                except AssertionError as fault:
                    faults.append(f"{case[0]}: {fault}")
            assert cases
            assert not faults, "\n".join(faults)

        test_each.__doc__ = rule.__doc__
        return test_each

    return over
