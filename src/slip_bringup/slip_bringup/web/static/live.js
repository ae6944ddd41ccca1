// `slip-vic watch` sends the same model without frames, then frames; see live.py.
