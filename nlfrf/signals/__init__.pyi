from .lines import LineGrid as LineGrid
from .orthogonal import OrthogonalMultisine as OrthogonalMultisine
