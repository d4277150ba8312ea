from .prove import BrokenRate as BrokenRate
from .prove import ScheduleProof as ScheduleProof
