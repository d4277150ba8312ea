"""Models and controllers to files, for people and for other programs.

models           models and controllers as JSON with a schema, exact to the bit
matrix_models    a model of several inputs and outputs as JSON
json_files       numbers and systems as JSON, and the files that hold them
matlab           MATLAB structs, and a loader beside them
certificates     what was proved, for someone else to prove again
pid_gains        a PID controller as its gains, and as the lines to type into a programmable controller
biquads          second-order sections of a discrete controller, as it runs on its target
friction_files   what a proof for a machine with friction starts from
"""
