"""The ground that every package of robust stands on; it knows nothing of loops.

states  what was decided, as enums: stable or not, holds or is violated, the verdicts
"""
