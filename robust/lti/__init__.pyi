from .sampling import discretize as discretize
from .sampling import sampled as sampled
