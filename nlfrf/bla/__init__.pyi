from .bla import DistortionLevels as DistortionLevels
from .cross_check import SecondOpinion as SecondOpinion
from .gains import RelativeGains as RelativeGains
from .gains import SingularValues as SingularValues
from .gains import rga as rga
from .gains import singular_values as singular_values
