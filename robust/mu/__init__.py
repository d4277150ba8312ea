"""The structured singular value: upper and lower bounds, certificates, real parameters.

blocks         the structure: the blocks, and the scalings that commute with them
both_bounds    both bounds of mu or of a worst gain in one call, for systems too
certification  the proof that mu is below a level at every frequency
crossings      the smallest perturbation found that moves a pole to the stability boundary
gain           the worst gain over a set: its bound, and a perturbation that attains it
intervals      the same proof with a scaling for each frequency interval
parameters     margins and bounds for real parameters
pieces         the frequency ranges on which a scaling proves a level
perturbations  lower bounds: a perturbation that makes the loop singular, verified
scalings       upper bounds by scalings, refined around their peaks
set_gain       the worst gain over a set, bounded at all frequencies by exact arithmetic
skewed         skewed mu at all frequencies, between a proof and a counterexample
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
