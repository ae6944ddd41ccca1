"""Named sensors and drives: they configure both nodes, so they live above both."""
