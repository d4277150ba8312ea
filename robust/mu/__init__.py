"""The structured singular value mu: the smallest perturbation of given blocks that makes det(I - N Delta) = 0.

blocks           the structure: which blocks, which scalings commute with it
upper            upper bounds by scalings, refined around their peaks
lower            lower bounds: a perturbation that makes the loop singular, verified
lmi              the upper bound by a convex program, to check against
gain             what a set of perturbations can make of a gain
certify          a level of mu proved at every frequency
real_parameters  the smallest real parameters that reach the stability boundary
parameter_margin  the box of real parameters a loop bears, proved part by part
"""
