"""What a picture shows."""


def labels(ax):
    """The texts of its legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def notes(ax):
    """The remarks inside a picture."""
    return [text.get_text() for text in ax.texts]
