# Every public name and where it is defined; `__init__.py` says which are the face.
from . import axis as axis
from . import friction as friction
from . import hysteresis as hysteresis
from . import io as io
from . import plot as plot
from . import rig as rig

# Bench: the friction rig and a sampled controller around it
# What both packages stand on
from ._base.arguments import DataWarning as DataWarning
from ._base.progress import progress_bar as progress_bar

# Identification: a record to its best linear approximation
from .bla.bla import Bla as Bla
from .bla.bla import DistortionLevels as DistortionLevels

# Several inputs and outputs
from .bla.bla import Frm as Frm
from .bla.cross_check import SecondOpinion as SecondOpinion
from .bla.cross_check import second_opinion as second_opinion
from .bla.from_frf import bla_from_frf as bla_from_frf
from .bla.gains import RelativeGains as RelativeGains
from .bla.gains import SingularValues as SingularValues
from .bla.gains import rga as rga
from .bla.gains import singular_values as singular_values
from .bla.identify import identify as identify
from .bla.noise_excitation import identify_noise as identify_noise

# Files
from .io.designs import load_multisine as load_multisine
from .io.designs import save_multisine as save_multisine
from .io.frf_tables import load_frf as load_frf
from .io.inspection import FileContents as FileContents
from .io.inspection import inspect_file as inspect_file
from .io.records import load_multirecord as load_multirecord
from .io.records import load_record as load_record
from .io.results import export_csv as export_csv
from .io.results import load as load
from .io.results import load_bla as load_bla
from .io.results import load_frm as load_frm
from .io.results import save as save
from .io.results import save_bla as save_bla
from .io.results import save_frm as save_frm
from .io.stored_records import save_record as save_record

# Records: what was measured
from .records.record import MultiRecord as MultiRecord
from .records.record import Record as Record
from .records.record import join_records as join_records
from .records.samples import multirecord_from_samples as multirecord_from_samples
from .records.samples import record_from_samples as record_from_samples
from .rig.bench.closed_loop import LoopResponse as LoopResponse
from .rig.bench.closed_loop import simulate_loop as simulate_loop
from .rig.bench.closed_loop import simulate_loops as simulate_loops
from .rig.bench.motion import Motion as Motion
from .rig.bench.motion import drive as drive
from .rig.bench.motion import run as run
from .rig.bench.rig import Rig as Rig
from .rig.bench.rig import paper_rig as paper_rig
from .rig.bench.rig import two_axis_stage as two_axis_stage
from .rig.bench.servo import ServoAxis as ServoAxis
from .rig.bench.servo import ServoDrive as ServoDrive
from .rig.bench.servo import ServoTrace as ServoTrace
from .rig.bench.servo import run_servo as run_servo
from .rig.bench.servo import servo_axis as servo_axis
from .rig.bench.servo import simulate_servo as simulate_servo
from .rig.bench.simulate import simulate as simulate

# Studies
from .rig.studies.level_study import LevelStudy as LevelStudy
from .rig.studies.level_study import level_study as level_study

# Excitation: what is played
from .signals.crest import reduce_crest as reduce_crest
from .signals.lines import LineGrid as LineGrid
from .signals.multisine import Multisine as Multisine
from .signals.multisine import multisine as multisine
from .signals.orthogonal import OrthogonalMultisine as OrthogonalMultisine

__version__: str
