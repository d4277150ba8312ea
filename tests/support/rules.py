"""A rule of the project held against all that it is for, in one test."""

from collections.abc import Callable, Iterable


def each(cases: Iterable[tuple]) -> Callable[[Callable[..., None]], Callable[[], None]]:
    """Make one test of a rule and its cases: it names every case that breaks the rule, by the first argument."""
    cases = list(cases)

    def over(rule: Callable[..., None]) -> Callable[[], None]:
        def test_each() -> None:
            faults = []
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
