from .exact.loops import Verification as Verification
from .search.bounded_real import certify_norm as certify_norm
from .search.certificate import Certificate as Certificate
