# Every public name and where it is defined; `__init__.py` says which are the face.
from . import analysis as analysis
from . import drive as drive
from . import friction as friction
from . import io as io
from . import lti as lti
from . import margins as margins
from . import models as models
from . import mu as mu
from . import plot as plot
from . import proofs as proofs
from . import reports as reports
from . import shaping as shaping
from . import synthesis as synthesis
from . import tuning as tuning
from ._base.warnings import DesignWarning as DesignWarning

# Modelling: a nominal, weights
# Analysis: a controller checked
# Loop shaping by hand
from .analysis.bounds import loop_bounds as loop_bounds
from .analysis.disk import DiskMargin as DiskMargin
from .analysis.disk import LoopMargins as LoopMargins
from .analysis.disk import disk_margin as disk_margin
from .analysis.disk import disk_margins as disk_margins
from .analysis.family import LoopFamily as LoopFamily
from .analysis.family import sample_loops as sample_loops
from .analysis.gap import ncf_margin as ncf_margin
from .analysis.gap import nu_gap as nu_gap
from .analysis.loop_level import LevelState as LevelState
from .analysis.loop_level import LoopLevel as LoopLevel
from .analysis.loop_level import LoopSignals as LoopSignals
from .analysis.loop_level import NoiseSignal as NoiseSignal
from .analysis.loop_level import SampledSignal as SampledSignal
from .analysis.loop_level import SignalLevel as SignalLevel
from .analysis.loop_level import SineSignal as SineSignal
from .analysis.loop_level import StepSignal as StepSignal
from .analysis.loop_level import predict_level as predict_level

# Performance: a loop in the numbers of a commissioning
from .analysis.performance import ClassicalMargins as ClassicalMargins
from .analysis.performance import LoopGains as LoopGains
from .analysis.performance import StepResponse as StepResponse
from .analysis.performance import loop_gains as loop_gains
from .analysis.performance import step_response as step_response
from .analysis.report import RobustnessReport as RobustnessReport
from .analysis.robustness import check as check
from .analysis.structured import check_structure as check_structure

# Uncertain: sets of plants
from .analysis.worst_plant import BreakingPerturbation as BreakingPerturbation
from .analysis.worst_plant import WorstCase as WorstCase
from .analysis.worst_plant import breaking_perturbation as breaking_perturbation
from .analysis.worst_plant import worst_case as worst_case
from .friction.classes import any_bounded as any_bounded
from .friction.classes import any_bristle as any_bristle
from .friction.classes import any_maxwell_slip as any_maxwell_slip
from .friction.classes import any_passive as any_passive

# Friction: how a loop moves, a proof for a class of friction
from .friction.describing_function import QuasiLinear as QuasiLinear
from .friction.describing_function import quasi_linear as quasi_linear
from .friction.identification import FrictionFit as FrictionFit
from .friction.identification import Gap as Gap
from .friction.identification import LevelBalance as LevelBalance
from .friction.identification import OpenQuestion as OpenQuestion
from .friction.identification import identify_friction as identify_friction
from .friction.in_motion import SlidingFit as SlidingFit
from .friction.in_motion import identify_sliding as identify_sliding
from .friction.levels import FrictionClass as FrictionClass
from .friction.linear_uncertainty import FrequencyTest as FrequencyTest
from .friction.linear_uncertainty import friction_frequency_test as friction_frequency_test

# Sliding: machines with friction
from .friction.plant import friction_plant as friction_plant
from .friction.plant import two_mass_plant as two_mass_plant
from .friction.prove import FrictionProof as FrictionProof
from .friction.prove import prove_friction as prove_friction
from .friction.reading import friction_class as friction_class

# Saturation: a machine with friction whose actuator saturates
from .friction.saturation import SaturatedProof as SaturatedProof
from .friction.saturation import prove_saturated as prove_saturated

# Files
from .io.biquads import controller_sections as controller_sections
from .io.certificates import save_certificate as save_certificate
from .io.certificates import verify_certificate as verify_certificate
from .io.matlab import export_matlab as export_matlab
from .io.models import load as load
from .io.models import load_controller as load_controller
from .io.models import load_model as load_model
from .io.models import save as save
from .io.models import save_controller as save_controller
from .io.models import save_model as save_model
from .io.pid import PidGains as PidGains
from .io.pid import pid_gains as pid_gains

# Systems: what a sampled controller sees
from .lti.sampling import discretize as discretize
from .lti.sampling import sampled as sampled
from .models.fit.nominal import NominalFit as NominalFit
from .models.fit.nominal import fit_nominal as fit_nominal
from .models.fit.nominal import frd as frd
from .models.fit.orders import OrderScan as OrderScan
from .models.fit.orders import scan_orders as scan_orders
from .models.fit.weights import WeightFit as WeightFit
from .models.fit.weights import control_weight as control_weight
from .models.fit.weights import delay_weight as delay_weight
from .models.fit.weights import fit_weight as fit_weight
from .models.fit.weights import performance_weight as performance_weight
from .models.sets.build import uncertainty as uncertainty
from .models.sets.interconnection import Block as Block
from .models.sets.interconnection import UncertainSystem as UncertainSystem
from .models.sets.interconnection import interconnection as interconnection
from .models.sets.model import UncertaintyModel as UncertaintyModel
from .models.validation import Validation as Validation
from .models.validation import validate as validate

# Mu: the structured singular value
from .mu.bounds import StructuredBounds as StructuredBounds
from .mu.bounds import mu_bounds as mu_bounds
from .mu.bounds import worst_gain_bounds as worst_gain_bounds
from .mu.certify import certify_mu as certify_mu
from .mu.gain import worst_gain as worst_gain
from .mu.lmi import mu_upper_lmi as mu_upper_lmi
from .mu.lower import mu_lower as mu_lower
from .mu.parameters import ParameterMargin as ParameterMargin
from .mu.parameters import parameter_margin as parameter_margin
from .mu.upper import MuBound as MuBound
from .mu.upper import mu_upper as mu_upper

# Verification: proofs that hold to the last bit
from .proofs.exact.loops import Verification as Verification

# Certificates: bounds proved at every frequency
from .proofs.search.bounded_real import certify_norm as certify_norm
from .proofs.search.certificate import Certificate as Certificate

# Reports: a whole run in one file
from .reports.page import write_report as write_report

# Shaping page: a loop shaped live
from .reports.shaping_page.page import write_shaping_page as write_shaping_page
from .reports.shaping_page.widget import shape as shape

# Fixed structure: controllers straight from the FRF
from .synthesis.fixed.design_frf import design_frf as design_frf
from .synthesis.fixed.structures import ControllerStructure as ControllerStructure
from .synthesis.hinf.design import Design as Design
from .synthesis.hinf.dk import DkDesign as DkDesign
from .synthesis.hinf.dk import dk_iteration as dk_iteration
from .synthesis.hinf.hinfsyn import Synthesis as Synthesis
from .synthesis.hinf.hinfsyn import hinfsyn as hinfsyn
from .synthesis.hinf.mixsyn import mixsyn as mixsyn
from .synthesis.hinf.ncfsyn import crossover_weight as crossover_weight
from .synthesis.hinf.ncfsyn import ncfsyn as ncfsyn

# Synthesis: controllers from Riccati equations
from .synthesis.nested_loops import cascade as cascade
from .synthesis.reduction import Reduction as Reduction
from .synthesis.reduction import reduce_controller as reduce_controller
from .synthesis.shaping import lag as lag
from .synthesis.shaping import lead as lead
from .synthesis.shaping import notch as notch
from .synthesis.shaping import pid as pid
from .synthesis.shaping import roll_off as roll_off

# Tuning: any structure, several loops and plants at once
from .synthesis.tuning.tune import tune as tune
from .synthesis.two_dof import Feedforward as Feedforward
from .synthesis.two_dof import Prefilter as Prefilter
from .synthesis.two_dof import feedforward as feedforward
from .synthesis.two_dof import prefilter as prefilter
