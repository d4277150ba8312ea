"""A machine with friction whose actuator saturates: a proof from every state, or up to a kick.

loop         the loop cut open at its actuator, with filters of the force it gives
multipliers  weights of friction and actuator together, by linear programs
dissipation  the inequality of both
kick         how hard a kick a stored energy allows
search       shares that the actuator may miss, tried one after another
proof        the door: machine, controller, class of friction and limit in, verdict and kick out
"""
