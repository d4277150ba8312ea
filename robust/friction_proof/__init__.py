"""A proof for the machine itself: a loop comes to rest with every friction of a class, or a member that breaks it.

proof        the door: a machine, a controller, a class of friction, one verdict
classes      classes of friction laws, without their parameters
multipliers  weights of filters on the friction, by a linear program
dissipation  the inequality they give, in states that come to rest
certify      from weights to a certificate, and how far it reaches
levels       machine and class read from measured levels
"""
