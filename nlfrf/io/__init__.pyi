from .designs import load_multisine as load_multisine
from .designs import save_multisine as save_multisine
from .frf_tables import load_frf as load_frf
from .inspection import FileContents as FileContents
from .results import load_bla as load_bla
from .results import save_bla as save_bla
from .stored_records import save_record as save_record
