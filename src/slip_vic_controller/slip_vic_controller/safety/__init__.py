"""What stands between the law and the joints: which inputs count, what the arm does, and what no effort exceeds."""
