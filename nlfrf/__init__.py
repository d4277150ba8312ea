"""Best linear approximations of nonlinear systems, with a bound on their distortion, from one multisine experiment.

    multisine -> Record -> identify -> Bla

Pictures are in `nlfrf.plot`, friction laws in `nlfrf.friction`, hysteresis in `nlfrf.hysteresis`.
"""

from nlfrf.bla import Bla
from nlfrf.checks import DataWarning
from nlfrf.crest import reduce_crest
from nlfrf.distortion import DistortionLevels
from nlfrf.identify import identify
from nlfrf.io import export_csv, load_bla, load_multisine, save_bla, save_multisine
from nlfrf.level_study import LevelStudy, level_study
from nlfrf.lines import LineGrid
from nlfrf.loop import LoopResponse, simulate_loop
from nlfrf.multisine import Multisine, multisine
from nlfrf.noise import identify_noise
from nlfrf.opinion import SecondOpinion, second_opinion
from nlfrf.record import Record, record_from_samples
from nlfrf.record_files import load_record, save_record
from nlfrf.rig import Motion, Rig, drive, paper_rig, run
from nlfrf.simulate import simulate

__version__ = "0.1.0"

__all__ = [
    "Bla",
    "DataWarning",
    "DistortionLevels",
    "LevelStudy",
    "LineGrid",
    "LoopResponse",
    "Motion",
    "Multisine",
    "Record",
    "Rig",
    "SecondOpinion",
    "drive",
    "export_csv",
    "identify",
    "identify_noise",
    "level_study",
    "load_bla",
    "load_multisine",
    "load_record",
    "multisine",
    "paper_rig",
    "record_from_samples",
    "reduce_crest",
    "run",
    "save_bla",
    "save_multisine",
    "save_record",
    "second_opinion",
    "simulate",
    "simulate_loop",
]
