"""Tests on a bed: cone, shear, repose, vertical cut, element, grading. Imports the engine and what is below it."""
