"""Everything that is read from a file or written to one.

records        records, from any measurement file
multirecords   records of several inputs or outputs
stored_records records as this package keeps them
inspection     what such a file holds, and a guess at how to load it
channels       the named channels inside such a file, by the reader of its kind
lost_rows      rows that a time column shows to be lost, and the periods that are whole
moments        whether channels were sampled at the same moments
npz            arrays of NPZ files, read to where they stay
designs        multisines, and the signals to play
results        `Bla`, `Frm` and tables
stored_values  any value of this package, field by field, with its schema and version
"""
