"""Tables as other programs write them: a head and columns of numbers."""

import numpy as np


def write_columns(path, table, names):
    """Write columns under their names, each number with as many digits as it has."""
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
