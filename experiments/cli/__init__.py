"""The command line. Imports every package of `experiments`; nothing imports it."""
