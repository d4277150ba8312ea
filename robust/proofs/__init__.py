"""Proofs: found in floating point, verified in exact arithmetic.

exact   verification in exact arithmetic
search  search for certificates
"""
