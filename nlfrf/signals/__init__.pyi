from .lines import LineGrid as LineGrid
