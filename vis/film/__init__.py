"""vis/film."""
