"""Proofs: one loop in exact arithmetic; matrices found in floating point, and verified exactly where that is known.

exact   verification in exact arithmetic
search  search for certificates
"""
