# Modelling: a nominal, weights
# Analysis: a controller checked
from .analysis.check import check as check
from .analysis.check_structure import StructuredReport as StructuredReport
from .analysis.check_structure import check_structure as check_structure
from .analysis.disk_margin import DiskMargin as DiskMargin
from .analysis.disk_margin import LoopMargins as LoopMargins
from .analysis.disk_margin import disk_margin as disk_margin
from .analysis.disk_margin import disk_margins as disk_margins
from .analysis.family import LoopFamily as LoopFamily
from .analysis.family import sample_loops as sample_loops
from .analysis.gap import ncf_margin as ncf_margin
from .analysis.gap import nu_gap as nu_gap
from .analysis.loop_level import LevelState as LevelState
from .analysis.loop_level import LoopLevel as LoopLevel
from .analysis.loop_level import SignalLevel as SignalLevel
from .analysis.loop_level import predict_level as predict_level
from .analysis.report import RobustnessReport as RobustnessReport
from .analysis.worst_case import WorstCase as WorstCase
from .analysis.worst_case import worst_case as worst_case

# Certificates: bounds proved at every frequency
from .certificates.bounded_real import certify_norm as certify_norm
from .certificates.certificate import Certificate as Certificate

# Files
from .files.biquads import controller_sections as controller_sections
from .files.certificates import save_certificate as save_certificate
from .files.certificates import verify_certificate as verify_certificate
from .files.matlab import export_matlab as export_matlab
from .files.models import load_controller as load_controller
from .files.models import load_model as load_model
from .files.models import save_controller as save_controller
from .files.models import save_model as save_model
from .files.pid_gains import PidGains as PidGains
from .files.pid_gains import pid_gains as pid_gains

# Fixed structure: controllers straight from the FRF
from .fixed_structure.design_frf import design_frf as design_frf
from .fixed_structure.proved import ProvedDesign as ProvedDesign
from .fixed_structure.proved import design_proved as design_proved
from .fixed_structure.structures import ControllerStructure as ControllerStructure

# Friction: how a loop moves, a proof for a class of friction
from .friction_motion.quasi_linear import QuasiLinear as QuasiLinear
from .friction_motion.quasi_linear import quasi_linear as quasi_linear
from .friction_proof.classes import any_bounded as any_bounded
from .friction_proof.classes import any_bristle as any_bristle
from .friction_proof.classes import any_maxwell_slip as any_maxwell_slip
from .friction_proof.classes import any_passive as any_passive
from .friction_proof.levels import FrictionClass as FrictionClass
from .friction_proof.levels import friction_class as friction_class
from .friction_proof.linear_uncertainty import FrequencyTest as FrequencyTest
from .friction_proof.linear_uncertainty import friction_frequency_test as friction_frequency_test
from .friction_proof.proof import FrictionProof as FrictionProof
from .friction_proof.proof import prove_friction as prove_friction

# Loop shaping by hand
from .loopshaping.bounds import loop_bounds as loop_bounds
from .loopshaping.compensators import lag as lag
from .loopshaping.compensators import lead as lead
from .loopshaping.compensators import notch as notch
from .loopshaping.compensators import pid as pid
from .loopshaping.compensators import roll_off as roll_off
from .modelling.design_warning import DesignWarning as DesignWarning
from .modelling.nominal import NominalFit as NominalFit
from .modelling.nominal import fit_nominal as fit_nominal
from .modelling.nominal import frd as frd
from .modelling.orders import OrderScan as OrderScan
from .modelling.orders import scan_orders as scan_orders
from .modelling.weight_formulas import control_weight as control_weight
from .modelling.weight_formulas import delay_weight as delay_weight
from .modelling.weight_formulas import performance_weight as performance_weight
from .modelling.weights import WeightFit as WeightFit
from .modelling.weights import fit_weight as fit_weight

# Mu: the structured singular value
from .mu.certify import certify_mu as certify_mu
from .mu.gain import worst_gain as worst_gain
from .mu.lmi import mu_upper_lmi as mu_upper_lmi
from .mu.lower import mu_lower as mu_lower
from .mu.parameter_margin import ParameterMargin as ParameterMargin
from .mu.parameter_margin import parameter_margin as parameter_margin
from .mu.upper import MuBound as MuBound
from .mu.upper import mu_upper as mu_upper

# Performance: a loop in the numbers of a commissioning
from .performance.classical import ClassicalMargins as ClassicalMargins
from .performance.loop_gains import LoopGains as LoopGains
from .performance.loop_gains import loop_gains as loop_gains
from .performance.loop_signals import LoopSignals as LoopSignals
from .performance.loop_signals import NoiseSignal as NoiseSignal
from .performance.loop_signals import SampledSignal as SampledSignal
from .performance.loop_signals import SineSignal as SineSignal
from .performance.loop_signals import StepSignal as StepSignal
from .performance.steps import StepResponse as StepResponse
from .performance.steps import step_response as step_response

# Reports: a whole run in one file
from .reports.page import write_report as write_report

# Saturation: a machine with friction whose actuator saturates
from .saturation.proof import SaturatedProof as SaturatedProof
from .saturation.proof import prove_saturated as prove_saturated

# Shaping page: a loop shaped live
from .shaping_page.page import write_shaping_page as write_shaping_page
from .shaping_page.widget import shape as shape

# Sliding: machines with friction
from .sliding.machine import sliding_machine as sliding_machine

# Synthesis: controllers from Riccati equations
from .synthesis.cascade import cascade as cascade
from .synthesis.design import Design as Design
from .synthesis.dk import DkDesign as DkDesign
from .synthesis.dk import dk_iteration as dk_iteration
from .synthesis.feedforward import Feedforward as Feedforward
from .synthesis.feedforward import feedforward as feedforward
from .synthesis.hinfsyn import Synthesis as Synthesis
from .synthesis.hinfsyn import hinfsyn as hinfsyn
from .synthesis.mixsyn import mixsyn as mixsyn
from .synthesis.ncfsyn import crossover_weight as crossover_weight
from .synthesis.ncfsyn import ncfsyn as ncfsyn
from .synthesis.prefilter import Prefilter as Prefilter
from .synthesis.prefilter import prefilter as prefilter
from .synthesis.reduce_controller import Reduction as Reduction
from .synthesis.reduce_controller import reduce_controller as reduce_controller

# Systems: what a sampled controller sees
from .systems.sampling import discretize as discretize
from .systems.sampling import sampled as sampled

# Uncertain: sets of plants
from .uncertain.breaking import BreakingPerturbation as BreakingPerturbation
from .uncertain.breaking import breaking_perturbation as breaking_perturbation
from .uncertain.interconnection import Block as Block
from .uncertain.interconnection import UncertainSystem as UncertainSystem
from .uncertain.interconnection import interconnection as interconnection
from .uncertain.matrix_model import MatrixUncertainty as MatrixUncertainty
from .uncertain.model import UncertaintyModel as UncertaintyModel
from .uncertain.model import uncertainty as uncertainty
from .validation.matrices import MatrixValidation as MatrixValidation
from .validation.records import Validation as Validation
from .validation.records import validate as validate

# Verification: proofs that hold to the last bit
from .verification.loops import Verification as Verification
