"""For developers: fault campaigns, long runs, and what a control cycle costs."""
