from .exact.loops import Verification as Verification
from .search.certificate import Certificate as Certificate
