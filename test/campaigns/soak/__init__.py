"""Soak: hours in real time over DDS, with memory and open files of every process watched for growth."""
