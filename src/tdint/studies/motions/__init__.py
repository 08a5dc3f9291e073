"""Ground motions for studies: selection, scaling, spectral matching, pairs, intensity measures."""
