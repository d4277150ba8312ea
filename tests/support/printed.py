"""What a value prints, without the line breaks that fit it to a screen."""


def unwrapped(thing):
    """The str() of a value on one line."""
    return " ".join(str(thing).split())
