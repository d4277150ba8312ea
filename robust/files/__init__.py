"""Models and controllers to files, for people and for other programs.

models           JSON with a schema, exact to the bit
matlab           MATLAB structs, and a loader beside them
certificates     what was proved, for someone else to prove again
biquads          second-order sections, as a controller runs on its target
report_page      the whole run, from the record to the verdict, in one HTML file
report_sections  its sections on the controller
report_data      its sections on what was measured and modelled
report_parts   what a section is made of: tables, pictures inside the page
report_words     systems and demands in words
"""
