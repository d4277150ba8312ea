"""Energy stored in a flow with jumps, proposed by one room and judged by another: it falls, or no one says so.

form         a flow with jumps, a supply, and what else is stored
riccati      a storage function proposed by a periodic Riccati equation
bernstein    the judge of it
search       slacks and intervals, one after another, until one passes
"""
