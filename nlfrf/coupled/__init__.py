"""Several coupled masses with friction: their matrices, and the compiled code that steps them together.

machine       matrices and laws of the axes, checked, and as the compiled code reads them
step_kernels  compiled steps of all axes, divided where the first of their laws turns
run_kernels   compiled runs: through given forces, and in a sampled loop
"""
