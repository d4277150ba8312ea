"""A picture to shape a loop in: the public names of `robust.loopshaping.picture`."""

from robust.loopshaping.picture import LoopPicture, plot_loop_bounds

__all__ = ["LoopPicture", "plot_loop_bounds"]
