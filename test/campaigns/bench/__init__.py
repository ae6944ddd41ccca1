"""The instrument: what a control cycle costs on this machine, part by part, as ratios measured side by side."""
