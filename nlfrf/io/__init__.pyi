from .frf_tables import load_frf as load_frf
from .readers.matlab import read_mat as read_mat
