"""Models and controllers to files, for people and for other programs.

models           models and controllers as JSON with a schema, exact to the bit
matrix_models    a model of several inputs and outputs as JSON
json_files       numbers and systems as JSON, and the files that hold them
matlab           MATLAB structs, and a loader beside them
certificates     what was proved, for someone else to prove again
pid_gains        a PID controller as its gains, and as the lines to type into a programmable controller
biquads          second-order sections of a discrete controller, as it runs on its target
friction_files   what a proof for a machine with friction starts from
report_page      the whole run, from the record to the verdict, in one HTML file
report_sections  sections of the report page on the controller: verdict, loop, check, worst case
report_data      sections of the report page on what was measured and modelled
report_verdicts  both verdicts side by side: of a check, of a proof for a class of friction
report_parts     what a section of the report page is made of: tables, pictures inside the page
report_words     a system, its roots, a demand in words for the report page
"""
