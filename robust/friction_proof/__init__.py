"""A proof for a given linear part and every friction of a class: the loop comes to rest, or a member breaks it.

proof                the door: a machine, a controller, a class of friction, one verdict
classes              classes of friction laws, without their parameters
multipliers          weights of filters on the friction, by a linear program
dissipation          the inequality they give, in states that come to rest
bristle_multipliers  the same for bristles that creep, by a cone program
bristle_dissipation  the inequality of creeping bristles
linear_uncertainty   the class beside an LTI error of the linear part: a test at frequencies, no proof
certify              from weights to a certificate, and how far it reaches
passivity            every passive friction: what damping a loop leaves at its port
levels               machine and class read from measured levels, and what of it is refused
level_fit            fit of one level with an element that slips, its misfit and its delay
port_levels          what is left of them as a spring and a damper, the machine taken off
flexible             machines of a nominal model, damped and undamped
"""
