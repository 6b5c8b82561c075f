"""Puts the folder of the stand-ins that tests share on the path."""
