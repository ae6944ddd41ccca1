"""The slip observer: from motion, wrench and slow, late slip samples to the slip velocity at every tick."""
