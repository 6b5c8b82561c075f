"""The engine: fields, kernels, neighbour lists, sleep, state, the core of a bed. Imports grains, contact, shapes."""
