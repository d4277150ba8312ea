from .search.certificate import Certificate as Certificate
