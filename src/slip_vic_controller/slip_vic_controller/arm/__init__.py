"""The arm as it is: state estimate of its joints, and the command that its drives take."""
