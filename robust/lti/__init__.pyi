from .sampling import discretize as discretize
