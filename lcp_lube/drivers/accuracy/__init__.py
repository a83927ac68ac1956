"""An accuracy asked for: grids from coarse to fine, and what they say of a number."""
