"""What sensors make of the truth: rate, latency, noise, faults; and the sensors that come with the package."""
