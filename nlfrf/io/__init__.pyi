from .frf_tables import load_frf as load_frf
from .inspection import FileContents as FileContents
