"""Files: records, results and designs, read and written.

axis_trace      records from the trace of a drive that played a designed experiment
channels        the named channels of a measurement file: streams, units, clocks, rates
designs         multisines and experiments on drives, as designs and as signals to play
direction       guess which channels are input, output and reference, and their period
frf_tables      FRFs in files of analysers and Bode plotters
inspection      the contents of a measurement file, and a guess at how to load it
measurement_files  which reader reads which kind of file; a file as its channels
moments         check that channels were sampled at the same times
npz             arrays of NPZ files, memory-mapped if possible
readers         readers of file formats
records         records, from any measurement file
results         `save` and `load` for all objects; tables of a `Bla`
rows            rows of a file that do not form one record: lost ones, parts, signals that alternate
stored_records  records written to a file, and read back
stored_values   any value of this package, field by field, with its schema and version
trials          one signal of a repeated trial: its column by name, on the clock of the trials
uneven_clock    time columns with unequal steps, and interpolation to equal steps
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
