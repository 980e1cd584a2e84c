"""Masks and depth maps of photographs by learned models, in the formats of a pepeseg upload."""
