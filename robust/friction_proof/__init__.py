"""A proof for the machine itself: a loop comes to rest with every friction of a class, or a member that breaks it.

proof        the door: a machine, a controller, a class of friction, one verdict
machine      the linear part of a machine with friction
classes      classes of friction laws, without their parameters
loop         the sliding loop: flows between samples, jumps at them
springs      refutation: a friction that never slips is a spring
multipliers  weights of filters on the friction, by a linear program
dissipation  the inequality they give, in states that come to rest
riccati      a storage function proposed by a periodic Riccati equation
bernstein    the judge of it
certify      from weights to a certificate, and how far it reaches
levels       machine and class read from measured levels
bounded      friction that is only known to be bounded: sure run-away, hunting
passive      every passive friction
"""
