"""A picture to shape a loop in: the public names of `robust.plot.shaping`."""

from robust.plot.shaping import LoopPicture, plot_loop_bounds

__all__ = ["LoopPicture", "plot_loop_bounds"]
