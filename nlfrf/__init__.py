"""Best linear approximations of nonlinear systems, with a bound on their distortion, from one multisine experiment.

    multisine -> Record -> identify -> Bla

Pictures are in `nlfrf.plot`, friction laws in `nlfrf.friction`, hysteresis in `nlfrf.hysteresis`.
"""

from nlfrf.bench.closed_loop import simulate_loop, simulate_loops
from nlfrf.bench.loop_response import LoopResponse
from nlfrf.bench.motion import Motion, drive, run
from nlfrf.bench.rig import Rig, paper_rig, two_axis_stage
from nlfrf.bench.simulate import simulate
from nlfrf.excitation.crest import reduce_crest
from nlfrf.excitation.lines import LineGrid
from nlfrf.excitation.multisine import Multisine, multisine
from nlfrf.excitation.orthogonal import OrthogonalMultisine
from nlfrf.files.designs import load_multisine, save_multisine
from nlfrf.files.inspection import FileContents, inspect_file
from nlfrf.files.multirecords import load_multirecord
from nlfrf.files.records import load_record, save_record
from nlfrf.files.results import export_csv, load, load_bla, load_frm, save_bla, save_frm
from nlfrf.identification.bla import Bla, DistortionLevels
from nlfrf.identification.noise_excitation import identify_noise
from nlfrf.identification.second_opinion import SecondOpinion, second_opinion
from nlfrf.multivariable.frm import Frm
from nlfrf.multivariable.gains import RelativeGains, SingularValues, rga, singular_values
from nlfrf.multivariable.identify import identify
from nlfrf.records.record import Record, join_records
from nlfrf.records.samples import record_from_samples
from nlfrf.records.several import MultiRecord, multirecord_from_samples
from nlfrf.shared.arguments import DataWarning
from nlfrf.shared.progress import progress_bar
from nlfrf.studies.level_study import LevelStudy, level_study

__version__ = "0.1.0"

__all__ = [
    "Bla",
    "DataWarning",
    "DistortionLevels",
    "FileContents",
    "Frm",
    "LevelStudy",
    "LineGrid",
    "LoopResponse",
    "Motion",
    "MultiRecord",
    "Multisine",
    "OrthogonalMultisine",
    "Record",
    "RelativeGains",
    "Rig",
    "SecondOpinion",
    "SingularValues",
    "drive",
    "export_csv",
    "identify",
    "identify_noise",
    "inspect_file",
    "join_records",
    "level_study",
    "load",
    "load_bla",
    "load_frm",
    "load_multirecord",
    "load_multisine",
    "load_record",
    "multirecord_from_samples",
    "multisine",
    "paper_rig",
    "progress_bar",
    "record_from_samples",
    "reduce_crest",
    "rga",
    "run",
    "save_bla",
    "save_frm",
    "save_multisine",
    "save_record",
    "second_opinion",
    "simulate",
    "simulate_loop",
    "simulate_loops",
    "singular_values",
    "two_axis_stage",
]
