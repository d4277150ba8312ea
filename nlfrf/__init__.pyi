# Bench: the friction rig and a sampled controller around it
from .bench.closed_loop import simulate_loop as simulate_loop
from .bench.closed_loop import simulate_loops as simulate_loops
from .bench.loop_response import LoopResponse as LoopResponse
from .bench.motion import Motion as Motion
from .bench.motion import drive as drive
from .bench.motion import run as run
from .bench.rig import Rig as Rig
from .bench.rig import paper_rig as paper_rig
from .bench.rig import two_axis_stage as two_axis_stage
from .bench.simulate import simulate as simulate

# Excitation: what is played
from .excitation.crest import reduce_crest as reduce_crest
from .excitation.lines import LineGrid as LineGrid
from .excitation.multisine import Multisine as Multisine
from .excitation.multisine import multisine as multisine
from .excitation.orthogonal import OrthogonalMultisine as OrthogonalMultisine

# Files
from .files.designs import load_multisine as load_multisine
from .files.designs import save_multisine as save_multisine
from .files.inspection import FileContents as FileContents
from .files.inspection import inspect_file as inspect_file
from .files.multirecords import load_multirecord as load_multirecord
from .files.records import load_record as load_record
from .files.results import export_csv as export_csv
from .files.results import load as load
from .files.results import load_bla as load_bla
from .files.results import load_frm as load_frm
from .files.results import save_bla as save_bla
from .files.results import save_frm as save_frm
from .files.stored_records import save_record as save_record

# Identification: a record to its best linear approximation
from .identification.bla import Bla as Bla
from .identification.bla import DistortionLevels as DistortionLevels
from .identification.noise_excitation import identify_noise as identify_noise
from .identification.second_opinion import SecondOpinion as SecondOpinion
from .identification.second_opinion import second_opinion as second_opinion

# Several inputs and outputs
from .multivariable.frm import Frm as Frm
from .multivariable.gains import RelativeGains as RelativeGains
from .multivariable.gains import SingularValues as SingularValues
from .multivariable.gains import rga as rga
from .multivariable.gains import singular_values as singular_values
from .multivariable.identify import identify as identify

# Records: what was measured
from .records.record import Record as Record
from .records.record import join_records as join_records
from .records.samples import record_from_samples as record_from_samples
from .records.several import MultiRecord as MultiRecord
from .records.several import multirecord_from_samples as multirecord_from_samples

# What both packages stand on
from .shared.arguments import DataWarning as DataWarning
from .shared.progress import progress_bar as progress_bar

# Studies
from .studies.level_study import LevelStudy as LevelStudy
from .studies.level_study import level_study as level_study

__version__: str
