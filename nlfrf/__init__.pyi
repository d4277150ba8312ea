# What most scripts need, and the submodules that hold the rest: one way to each public name.
from . import bla as bla
from . import friction as friction
from . import hysteresis as hysteresis
from . import io as io
from . import plot as plot
from . import rig as rig
from . import signals as signals
from ._base.arguments import DataWarning as DataWarning
from ._base.progress import progress_bar as progress_bar
from .bla.bla import Bla as Bla
from .bla.cross_check import second_opinion as second_opinion
from .bla.from_frf import bla_from_frf as bla_from_frf
from .bla.identify import identify as identify
from .bla.noise_excitation import identify_noise as identify_noise
from .io.inspection import inspect_file as inspect_file
from .io.records import load_record as load_record
from .io.results import export_csv as export_csv
from .io.results import load as load
from .io.results import save as save
from .records.record import Record as Record
from .records.record import join_records as join_records
from .records.samples import record_from_samples as record_from_samples
from .rig.bench.level_study import level_study as level_study
from .rig.bench.presets import servo_axis as servo_axis
from .rig.bench.rig import paper_rig as paper_rig
from .rig.bench.simulate import simulate as simulate
from .signals.crest import reduce_crest as reduce_crest
from .signals.multisine import Multisine as Multisine
from .signals.multisine import multisine as multisine

__version__: str
