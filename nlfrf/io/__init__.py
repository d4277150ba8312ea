"""Files: records, results and designs, read and written.

axis_trace      the trace of a drive, read into records with the experiment that was played
channels        the named channels of a measurement file, by the reader of its kind
designs         multisines, and the signals to play
direction       which channels are input, output and reference, and their period
frf_tables      FRFs in files of analysers and Bode plotters
inspection      the contents of a measurement file, and a guess at how to load it
moments         check that channels were sampled at the same moments
npz             arrays of NPZ files, memory-mapped if possible
readers         readers of file formats
records         records, from any measurement file
results         `Bla` and tables
stored_records  records written to a file, and read back
stored_values   any value of this package, field by field, with its schema and version
uneven_clock    time columns with unequal steps, and their rows on an even clock
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
