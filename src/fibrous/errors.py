"""What a user may do wrong: every error of the library is one of these, its text one line with the remedy."""

from collections.abc import Iterator
from contextlib import contextmanager


class FibrousError(Exception):
    """Base of all errors that name a mistake in input, config or files rather than a fault of the library."""


@contextmanager
def naming(who: str) -> Iterator[None]:
    """Put `who` in front of any of these errors that is raised inside, so that its line says which network it means."""
    try:
        yield
    except FibrousError as error:
        raise type(error)(f"{who}: {error}") from None


class ConfigError(FibrousError):
    """A config value is unknown, of the wrong type, impossible, or contradicts another."""


class DatasetError(FibrousError):
    """A results file is missing, truncated, foreign, or cannot be written."""


class NetworkError(FibrousError):
    """A network is not one: dangling indices, NaN, floating parts, or no way to generate it."""


class LoadError(FibrousError):
    """A load is unknown or cannot reach what is asked of it."""


class FitError(FibrousError):
    """A fit or a prediction was asked for outside what the data supports."""


class ConvergenceError(FibrousError):
    """An equilibrium was demanded where none was found."""
