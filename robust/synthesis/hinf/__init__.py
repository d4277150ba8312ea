"""H-infinity synthesis: controllers from Riccati equations.

descent            scalings of D-K iteration moved along the gradient of the least norm
design             `Design`: a controller and the level it reaches
dk                 D-K iteration: several uncertainties and a performance
generalised_plant  the plant made ready: hidden modes refused, scaled, regular, normalised; and K taken back
hinfsyn            any generalised plant
mixsyn             weighted S, K S and T made small together
ncfsyn             loop shaping by Glover and McFarlane
"""
