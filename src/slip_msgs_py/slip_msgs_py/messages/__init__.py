"""Values to and from messages: typed, and as CDR bytes."""
