"""Classes of friction laws, described by bounds instead of parameters: one module each, named like
its class, with its proof.
"""
