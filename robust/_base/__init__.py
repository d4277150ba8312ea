"""What every module of this package uses.

states  what was decided, as enums: stable or not, holds or is violated, the verdicts
"""
